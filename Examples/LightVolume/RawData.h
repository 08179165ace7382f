// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Bytes of a file, unpacked and turned into a VTK array: what NIfTI, MetaImage and
 * NRRD have in common. These readers are the program's own because VTK's drop the
 * orientation, and fill up short files in silence.
 */
#ifndef LightVolume_RawData_h
#define LightVolume_RawData_h

#include "Volume.h"

#include <cstdint>

namespace lightvolume
{
using Bytes = std::vector<unsigned char>;

/** The bytes of a file from an offset on. Throws an Error that names the file. */
Bytes ReadBytes(const std::string& path, std::uint64_t offset = 0);

bool IsGzip(const Bytes& bytes);

/**
 * Unpack gzip or zlib data, several members in a row too. Stops after `limit` bytes of
 * output; a stream that ends early throws an Error unless `limit` was reached.
 */
Bytes Inflate(const Bytes& bytes, const std::string& path, std::uint64_t limit);

/** VTK's scalar type of a file's; 64-bit integers become double on the way. */
struct SampleType
{
  enum Kind
  {
    Unsigned,
    Signed,
    Floating
  } Of;
  int Size; // bytes
};

/**
 * Which samples to take: sample n lies at index start + n * stride. With `stride` the
 * number of components a component is picked, with `start` a frame.
 */
struct Selection
{
  std::uint64_t Start = 0;
  std::uint64_t Stride = 1;
};

/**
 * An image of these dimensions (extent from 0) with its scalars. Short data throws an Error
 * with both sizes. slope and intercept other than 1 and 0 give float (double for
 * wide types): value * slope + intercept.
 */
vtkSmartPointer<vtkImageData> MakeImage(const std::array<int, 3>& dims, const Bytes& bytes,
  std::uint64_t offset, SampleType type, bool bigEndian, const Selection& selection, double slope,
  double intercept, const std::string& path);

/** Positive dimensions whose product can be held: else an Error. */
std::uint64_t CheckDimensions(const std::array<int, 3>& dims, const std::string& path);

std::string Folder(const std::string& path);
std::string LowerCase(std::string text);
std::string Trim(const std::string& text);
std::vector<std::string> Words(const std::string& text);
/** Numbers separated by blanks, commas or brackets; an Error if anything else is there. */
std::vector<double> Numbers(const std::string& text, const std::string& what);

} // namespace lightvolume

#endif
