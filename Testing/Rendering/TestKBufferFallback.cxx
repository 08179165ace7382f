// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Without OpenGL 4.3 vtkBucketedKBufferPass says so once, and VTK's exact pass
 * draws. A program of its own: Mesa reads the version to offer once.
 */
#include "KBufferScene.h"

#include <cstdlib>

using namespace lighttransport::testing;

int main(int argc, char* argv[])
{
  setenv("MESA_GL_VERSION_OVERRIDE", "3.3", 1);
  if (!canRender())
  {
    return Suite::skipped();
  }
  Suite suite(argc, argv);
  const auto layers = randomLayers(6, 3);
  KBufferScene scene;
  scene.add(layers);
  auto pixels = scene.capture();
  GLint version[2] = { 0, 0 };
  glGetIntegerv(GL_MAJOR_VERSION, &version[0]);
  glGetIntegerv(GL_MINOR_VERSION, &version[1]);
  if (10 * version[0] + version[1] >= 43)
  {
    std::cout << "OpenGL " << version[0] << "." << version[1] << " is not Mesa's: skipped\n";
    return Suite::skipped();
  }
  for (int frame = 0; frame < 3; ++frame)
  {
    // Peeling rounds to 8 bits after each layer.
    LT_CHECK(suite, scene.differenceFromOver(pixels, layers, false) <= 4.);
    LT_CHECK(suite, scene.pass->GetUsedFallback());
    pixels = scene.capture();
  }
  LT_CHECK(suite, scene.log->messages.size() == 1);
  LT_CHECK(suite,
    !scene.log->messages.empty() &&
      scene.log->messages[0].find("expected 4.3") != std::string::npos);
  LT_CHECK(suite, scene.pass->GetNumberOfMergedFragments() == 0);
  LT_CHECK(suite, openGLErrors().empty());
  LT_CHECK(suite, openGLDebugErrors() == 0);
  return suite.result();
}
