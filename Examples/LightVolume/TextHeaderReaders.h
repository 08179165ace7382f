// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * The two formats whose header is text and whose data is raw: MetaImage and NRRD.
 *
 * MetaImage: TransformMatrix holds the axes' directions one after the other (its row a is axis
 * a), Offset the first voxel; both LPS, turned into RAS here. NRRD: space directions and space
 * origin, turned into RAS from LPS or LAS; without a patient space they stay as they are.
 */
#ifndef LightVolume_TextHeaderReaders_h
#define LightVolume_TextHeaderReaders_h

#include "Volume.h"

namespace lightvolume
{
/** .mha, .mhd: any ElementType up to 64 bits, compressed or not, local, file, LIST or pattern. */
Volume ReadMetaImage(const std::string& path, int frame, int component);

/** .nrrd, .nhdr: raw, gzip or ascii; one data file. */
Volume ReadNrrd(const std::string& path, int frame, int component);

} // namespace lightvolume

#endif
