// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * vtkBucketedKBufferPass without stylisation: "over" of the sorted layers within
 * 1/255 on 32 layers, in any order of actors to the bit; what is beyond the
 * layers merged as documented; opaque surfaces, transparent backgrounds, bands.
 */
#include "KBufferScene.h"

#include "vtkCurvatureOpacityProperty.h"
#include "vtkPiecewiseFunction.h"

using namespace lighttransport::testing;

namespace
{
void testOver(Suite& suite)
{
  for (const unsigned seed : { 1U, 2U })
  {
    for (const int count : { 1, 7, 32 })
    {
      for (const bool faint : { false, true })
      {
        for (const int precision : { 0, 1 })
        {
          KBufferScene scene;
          auto layers = randomLayers(count, seed, faint ? .01 : .03, faint ? .06 : .9);
          // One that passes through the others.
          layers.back().tilt = 3.17;
          scene.add(layers);
          scene.pass->SetColorPrecision(precision);
          const auto pixels = scene.capture();
          const double d = scene.differenceFromOver(pixels, layers, false);
          suite.check(d <= 1.,
            std::to_string(count) + " layers, seed " + std::to_string(seed) + ", precision " +
              std::to_string(precision) + ": " + std::to_string(d) + "/255 from over",
            __FILE__, __LINE__);
          LT_CHECK(suite, scene.pass->GetNumberOfFragments() == count * 40 * 30);
          LT_CHECK(suite, scene.pass->GetNumberOfMergedFragments() == 0);
          LT_CHECK(suite, !scene.pass->GetUsedFallback() && scene.log->messages.empty());
          LT_CHECK(suite, openGLErrors().empty());
        }
      }
    }
  }
}

/** As many layers as there can be, plain and with a style that changes nothing. */
void testMost(Suite& suite)
{
  KBufferScene scene(24, 20);
  scene.pass->SetNumberOfLayers(65); // clamped
  LT_CHECK(suite, scene.pass->GetNumberOfLayers() == 64);
  auto layers = randomLayers(64, 13, .01, .1);
  layers.back().tilt = 3.17;
  scene.add(layers);
  for (const bool styled : { false, true })
  {
    vtkNew<vtkPiecewiseFunction> one;
    one->AddPoint(-1., 1.);
    one->AddPoint(1., 1.);
    scene.pass->GetCurvatureOpacityProperty()->SetShadingFunction(one);
    scene.pass->GetCurvatureOpacityProperty()->SetCurvatureShading(styled);
    const double d = scene.differenceFromOver(scene.capture(), layers, false);
    suite.check(d <= 1.5, "64 layers, styled " + std::to_string(styled) + ": " + std::to_string(d),
      __FILE__, __LINE__);
    LT_CHECK(suite, scene.pass->GetNumberOfFragments() == 64 * 24 * 20);
    LT_CHECK(suite, scene.pass->GetNumberOfMergedFragments() == 0);
  }
  scene.pass->SetNumberOfLayers(0);
  LT_CHECK(suite, scene.pass->GetNumberOfLayers() == 1);
}

/** Ties in depth, intersections and a merged tail among them. */
void testPermutations(Suite& suite)
{
  const unsigned seed = 7;
  std::cout << "seed " << seed << "\n";
  auto layers = randomLayers(20, seed);
  for (int i = 0; i < 6; ++i)
  {
    layers[i].z = layers[i / 3].z; // three coplanar ones, twice
  }
  layers[9].tilt = 5.;
  layers[10].box = { .2, .7, .1, .8 };
  for (const int kept : { 32, 6, 1 })
  {
    std::mt19937 random(seed);
    std::vector<unsigned char> first;
    vtkTypeInt64 merged = 0;
    for (int run = 0; run < 4; ++run)
    {
      KBufferScene scene;
      scene.pass->SetNumberOfLayers(kept);
      scene.add(layers);
      const auto pixels = scene.capture();
      if (run == 0)
      {
        first = pixels;
        merged = scene.pass->GetNumberOfMergedFragments();
      }
      LT_CHECK(suite, largestDifference(first, pixels) == 0);
      LT_CHECK(suite, scene.pass->GetNumberOfMergedFragments() == merged);
      std::shuffle(layers.begin(), layers.end(), random);
    }
    LT_CHECK(suite, (merged > 0) == (kept < 20));
  }
}

void testTail(Suite& suite)
{
  const int count = 40;
  const int kept = 5;
  auto layers = randomLayers(count, 11, .02, .3);
  KBufferScene scene;
  scene.pass->SetNumberOfLayers(kept);
  scene.add(layers);
  const auto pixels = scene.capture();
  LT_CHECK(suite, scene.pass->GetNumberOfMergedFragments() == (count - kept) * 40 * 30);

  // The tail is one layer: opacity 1 - prod(1 - alpha), colour the mean by alpha.
  std::sort(layers.begin(), layers.end(), [](const Layer& a, const Layer& b) { return a.z > b.z; });
  Layer tail;
  tail.z = layers[kept].z;
  double transparency = 1.;
  double weight = 0.;
  Rgba sum = { 0., 0., 0., 0. };
  for (int i = kept; i < count; ++i)
  {
    const double alpha = layers[i].color[3];
    transparency *= 1. - alpha;
    weight += alpha;
    for (int c = 0; c < 3; ++c)
    {
      sum[c] += alpha * layers[i].color[c];
    }
  }
  tail.color = { sum[0] / weight, sum[1] / weight, sum[2] / weight, 1. - transparency };
  layers.resize(kept);
  layers.push_back(tail);
  LT_CHECK(suite, scene.differenceFromOver(pixels, layers, false) <= 1.);

  // An opaque layer in the tail hides what is behind all of it.
  KBufferScene hidden;
  hidden.pass->SetNumberOfLayers(2);
  auto few = randomLayers(3, 5);
  few[0].z = 3.;
  few[1].z = 2.;
  few[2].z = 1.;
  few[2].color = { .3, .6, .9, 1. };
  hidden.add(few);
  auto* last = vtkActor::SafeDownCast(hidden.renderer->GetActors()->GetLastItem());
  last->ForceTranslucentOn();
  LT_CHECK(suite, hidden.differenceFromOver(hidden.capture(), few, false) <= 1.);
  LT_CHECK(suite, hidden.pass->GetNumberOfMergedFragments() == 40 * 30);
}

void testOpaque(Suite& suite)
{
  // In front on the left, behind on the right, at the depth of a layer in the middle.
  auto layers = randomLayers(12, 21);
  KBufferScene scene(60, 30);
  scene.add(layers);
  Layer wall;
  wall.color = { .9, .8, .1, 1. };
  wall.tilt = -8.;
  wall.z = 4.;
  scene.add({ wall });
  const auto pixels = scene.capture();
  std::vector<Layer> all = layers;
  all.push_back(wall);
  double largest = 0.;
  for (int column = 0; column < 60; ++column)
  {
    // Where a layer cuts the wall either may be seen.
    const double z = wall.z + wall.tilt * scene.x(column);
    if (std::any_of(
          layers.begin(), layers.end(), [z](const Layer& l) { return std::abs(l.z - z) < .15; }))
    {
      continue;
    }
    const Rgba expected = over(all, scene.x(column), { .2, .4, .1, 1. });
    for (int c = 0; c < 3; ++c)
    {
      largest =
        std::max(largest, std::abs(pixels[4 * (15 * 60 + column) + c] - 255. * expected[c]));
    }
  }
  LT_CHECK(suite, largest <= 1.);

  // A translucent layer on an opaque surface is seen, as with VTK's depth test.
  KBufferScene coplanar;
  Layer floor;
  floor.color = { 1., 0., 0., 1. };
  Layer film;
  film.color = { 0., 0., 1., .5 };
  coplanar.add({ floor, film });
  LT_CHECK(suite, coplanar.differenceFromOver(coplanar.capture(), { floor, film }, false) <= 1.);

  // Nothing translucent: the pass draws the rest; nothing at all: the background.
  KBufferScene opaque;
  opaque.add({ floor });
  LT_CHECK(suite, opaque.differenceFromOver(opaque.capture(), { floor }, false) <= 1.);
  LT_CHECK(suite, opaque.pass->GetNumberOfFragments() == 0);
  KBufferScene empty;
  LT_CHECK(suite, empty.differenceFromOver(empty.capture(), {}, false) <= 1.);
}

void testBackground(Suite& suite)
{
  for (const double alpha : { 0., .5, 1. })
  {
    const auto layers = randomLayers(9, 31);
    KBufferScene scene;
    scene.renderer->SetBackground(0., 0., 0.);
    scene.renderer->SetBackgroundAlpha(alpha);
    scene.add(layers);
    const auto pixels = scene.capture();
    LT_CHECK(suite, scene.differenceFromOver(pixels, layers, true) <= 1.);
  }
}

/** Where the nodes do not fit, bands; the same picture to the bit. */
void testBands(Suite& suite)
{
  const auto layers = randomLayers(24, 41);
  KBufferScene scene(120, 90);
  scene.add(layers);
  const auto expected = scene.capture();
  const vtkTypeInt64 fragments = scene.pass->GetNumberOfFragments();
  LT_CHECK(suite, scene.pass->GetNumberOfBands() == 1);
  scene.pass->SetMemoryLimit(1); // clamped to 1 MiB
  LT_CHECK(suite, scene.pass->GetMemoryLimit() == 1 << 20);
  for (int frame = 0; frame < 2; ++frame)
  {
    LT_CHECK(suite, largestDifference(expected, scene.capture()) == 0);
    LT_CHECK(suite, scene.pass->GetNumberOfBands() > 3);
    LT_CHECK(suite, scene.pass->GetNumberOfFragments() == fragments);
  }
  // The second frame starts with the bands of the first.
  LT_CHECK(suite, scene.pass->GetNumberOfGeometryPasses() == scene.pass->GetNumberOfBands());
  LT_CHECK(suite, scene.pass->GetMemoryInBytes() < (1 << 20) + 120 * 90 * 4 + 4096);
  scene.pass->SetMemoryLimit(1 << 30);
  scene.window->Render();
  LT_CHECK(suite, largestDifference(expected, scene.capture()) == 0);
  LT_CHECK(suite, openGLErrors().empty());
}
} // namespace

int main(int argc, char* argv[])
{
  if (!canRender())
  {
    return Suite::skipped();
  }
  Suite suite(argc, argv);
  testOver(suite);
  testMost(suite);
  testPermutations(suite);
  testTail(suite);
  testOpaque(suite);
  testBackground(suite);
  testBands(suite);
  LT_CHECK(suite, openGLDebugErrors() == 0);
  return suite.result();
}
