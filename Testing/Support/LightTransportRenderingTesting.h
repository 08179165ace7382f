// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * What tests that render need on top of LightTransportTesting.h: a window
 * wherever there is one, its picture as an image, numbers from the picture, a
 * comparison with a baseline, OpenGL's errors.
 *
 *   if (!canRender())
 *   {
 *     return Suite::skipped();
 *   }
 *   vtkNew<vtkRenderWindow> window;
 *   ...
 *   const Picture picture = capture(window);
 *   const Color mean = regionMean(picture, 10, 10, 19, 19);
 *   compareWithBaseline(suite, picture, "TestOfMine");
 *   LT_CHECK(suite, openGLErrors().empty());
 */
#ifndef LightTransportRenderingTesting_h
#define LightTransportRenderingTesting_h

#include "vtk_glew.h" // must come before any other OpenGL header

#include "LightTransportTesting.h"

#include "vtkImageData.h"
#include "vtkLightTransportEGLRenderWindow.h"
#include "vtkNew.h"
#include "vtkPNGReader.h"
#include "vtkPNGWriter.h"
#include "vtkRenderWindow.h"
#include "vtkSmartPointer.h"
#include "vtkUnsignedCharArray.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <string>

namespace lighttransport
{
namespace testing
{
using Picture = vtkSmartPointer<vtkImageData>;
using Color = std::array<double, 3>;

/** Call first: headless windows where there is no DISPLAY; false where neither EGL nor X is. */
inline bool canRender()
{
  vtkLightTransportEGLRenderWindow::UseIfHeadless();
  const char* display = std::getenv("DISPLAY");
  if ((display && *display) || vtkLightTransportEGLRenderWindow::IsAvailable())
  {
    return true;
  }
  std::cout << "neither EGL nor X: skipped ("
            << vtkLightTransportEGLRenderWindow::GetReasonUnavailable() << ")\n";
  return false;
}

/** Renders and reads the window: RGB, 8 bits, the first row is the lowest. */
inline Picture capture(vtkRenderWindow* window)
{
  window->Render();
  const int* size = window->GetActualSize();
  Picture picture = Picture::New();
  picture->SetDimensions(size[0], size[1], 1);
  picture->AllocateScalars(VTK_UNSIGNED_CHAR, 3);
  vtkNew<vtkUnsignedCharArray> pixels;
  window->GetPixelData(0, 0, size[0] - 1, size[1] - 1, 1, pixels);
  std::copy_n(pixels->GetPointer(0), pixels->GetNumberOfValues(),
    static_cast<unsigned char*>(picture->GetScalarPointer()));
  return picture;
}

inline Color pixel(vtkImageData* picture, int x, int y)
{
  const unsigned char* p = static_cast<unsigned char*>(picture->GetScalarPointer(x, y, 0));
  return { static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2]) };
}

/** Peak signal to noise ratio of two pictures of one size: dB, where they are the same that of one
 * value one level off. */
inline double psnr(vtkImageData* a, vtkImageData* b)
{
  int size[3];
  a->GetDimensions(size);
  double squares = 0.;
  for (int y = 0; y < size[1]; ++y)
  {
    for (int x = 0; x < size[0]; ++x)
    {
      for (int c = 0; c < 3; ++c)
      {
        const double d = pixel(a, x, y)[c] - pixel(b, x, y)[c];
        squares += d * d;
      }
    }
  }
  return 10. * std::log10(255. * 255. * 3. * size[0] * size[1] / std::max(squares, 1.));
}

/** Mean colour (0..255) of the pixels from (x0, y0) to (x1, y1), both included; y upwards. */
inline Color regionMean(vtkImageData* picture, int x0, int y0, int x1, int y1)
{
  Color sum = { 0., 0., 0. };
  for (int y = y0; y <= y1; ++y)
  {
    for (int x = x0; x <= x1; ++x)
    {
      const Color color = pixel(picture, x, y);
      for (int c = 0; c < 3; ++c)
      {
        sum[c] += color[c];
      }
    }
  }
  const double pixels = static_cast<double>(x1 - x0 + 1) * (y1 - y0 + 1);
  return { sum[0] / pixels, sum[1] / pixels, sum[2] / pixels };
}

/** How far two pictures are apart; sizes that differ are as far as can be. */
struct Difference
{
  double largest = 255.;        // largest difference of a channel
  double mean = 255.;           // mean absolute difference over pixels and channels
  double fractionDiffering = 1; // of pixels, with any difference above 8
};

inline Difference difference(vtkImageData* a, vtkImageData* b)
{
  Difference result;
  int da[3];
  int db[3];
  a->GetDimensions(da);
  b->GetDimensions(db);
  if (!std::equal(da, da + 3, db))
  {
    return result;
  }
  double largest = 0.;
  double sum = 0.;
  double differing = 0.;
  for (int y = 0; y < da[1]; ++y)
  {
    for (int x = 0; x < da[0]; ++x)
    {
      const Color ca = pixel(a, x, y);
      const Color cb = pixel(b, x, y);
      double ofPixel = 0.;
      for (int c = 0; c < 3; ++c)
      {
        const double d = std::abs(ca[c] - cb[c]);
        sum += d;
        ofPixel = std::max(ofPixel, d);
      }
      largest = std::max(largest, ofPixel);
      differing += ofPixel > 8. ? 1. : 0.;
    }
  }
  const double pixels = static_cast<double>(da[0]) * da[1];
  result.largest = largest;
  result.mean = sum / (3. * pixels);
  result.fractionDiffering = differing / pixels;
  return result;
}

inline void writePicture(vtkImageData* picture, const std::string& path)
{
  vtkNew<vtkPNGWriter> writer;
  writer->SetInputData(picture);
  writer->SetFileName(path.c_str());
  writer->Write();
}

/** Writes NAME.png into the -T folder, where a person can look at it. */
inline void writePicture(const Suite& suite, vtkImageData* picture, const std::string& name)
{
  writePicture(picture, suite.temporary + "/" + name + ".png");
}

/**
 * Compares with Baseline/NAME.png, and leaves the picture in the -T folder. Another
 * GPU draws edges and text a little differently: up to 3 % of the pixels may
 * differ visibly, and the mean by 1.5 of 255. Numbers in tests are the
 * stricter judge; this one is for what they don't see.
 */
inline void compareWithBaseline(Suite& suite, vtkImageData* picture, const std::string& name,
  double fractionDiffering = 0.03, double mean = 1.5)
{
  writePicture(suite, picture, name);
  const std::string baseline = suite.baselines + "/" + name + ".png";
  if (!std::ifstream(baseline).good())
  {
    suite.check(false, "no baseline " + baseline + "; see " + suite.temporary + "/" + name + ".png",
      __FILE__, __LINE__);
    return;
  }
  vtkNew<vtkPNGReader> reader;
  reader->SetFileName(baseline.c_str());
  reader->Update();
  const Difference d = difference(picture, reader->GetOutput());
  suite.check(d.fractionDiffering <= fractionDiffering && d.mean <= mean,
    name + " differs from its baseline: " + std::to_string(100. * d.fractionDiffering) +
      " % of the pixels, mean " + std::to_string(d.mean) + ", largest " +
      std::to_string(d.largest) + "; see " + suite.temporary + "/" + name + ".png",
    __FILE__, __LINE__);
}

/** The pending OpenGL errors of the current context, and clears them; empty if none. */
inline std::string openGLErrors()
{
  std::string errors;
  for (int i = 0; i < 16; ++i)
  {
    const GLenum error = glGetError();
    if (error == GL_NO_ERROR)
    {
      break;
    }
    errors += (errors.empty() ? "OpenGL error " : ", ") + std::to_string(error);
  }
  return errors;
}
} // namespace testing
} // namespace lighttransport

#endif
