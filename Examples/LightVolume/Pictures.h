// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * The pictures of a run: the volume alone, shaded, with shadows, with its light, and three slices.
 * All come from one window, so the volume is uploaded once.
 */
#ifndef LightVolume_Pictures_h
#define LightVolume_Pictures_h

#include "Options.h"
#include "Presets.h"
#include "Volume.h"

#include <memory>

class vtkLightFieldProperty;

namespace lightvolume
{
class Pictures
{
public:
  Pictures(
    const Volume& volume, const Statistics& statistics, const Look& look, const Options& options);
  ~Pictures();
  Pictures(const Pictures&) = delete;
  void operator=(const Pictures&) = delete;

  /** "" where pictures can be made, else why not. */
  static std::string WhyNot();

  void SetLight(vtkImageData* light, const std::array<double, 3>& slicePosition);
  /** Small lines below the picture. */
  void SetCaption(const std::vector<std::string>& lines);

  /**
   * kind: plain, lit, slices, flux or arrows; shaded, shadows or environment, which need no light:
   * VTK's own shading by a key light and a weak headlight, the same with shadows, and in a studio.
   * Throws an Error when OpenGL complains.
   */
  void Write(const std::string& kind, const std::string& path);

private:
  struct Parts;
  std::unique_ptr<Parts> P;
};

} // namespace lightvolume

#endif
