// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Feature lines where mathematics has them: on waves z = A sin(k x) ridges and valleys
 * at the crests, demarcating curves at the inflections, and suggestive contours at
 * every other inflection of the tilted surface; occluding contours around a sphere.
 * All as wide as asked for, in pixels, at any resolution, behind other layers too.
 */
#include "KBufferScene.h"

#include "vtkCurvatureOpacityProperty.h"
#include "vtkDoubleArray.h"
#include "vtkPointData.h"
#include "vtkSphereSource.h"

using namespace lighttransport::testing;

namespace
{
const double Pi = 3.14159265358979;
const double Waves = 2.;
const double Amplitude = .04;

vtkSmartPointer<vtkActor> whiteActor(vtkMapper* mapper)
{
  auto actor = vtkSmartPointer<vtkActor>::New();
  actor->SetMapper(mapper);
  actor->GetProperty()->SetAmbient(1.);
  actor->GetProperty()->SetDiffuse(0.);
  actor->ForceTranslucentOn();
  return actor;
}

/** On [0,1]^2, with the exact normals. */
vtkSmartPointer<vtkActor> wavesActor()
{
  constexpr int N = 300;
  vtkNew<vtkPoints> points;
  vtkNew<vtkCellArray> cells;
  vtkNew<vtkDoubleArray> normals;
  normals->SetNumberOfComponents(3);
  for (int i = 0; i <= N; ++i)
  {
    const double x = double(i) / N;
    const double slope = Amplitude * 2. * Pi * Waves * std::cos(2. * Pi * Waves * x);
    const double length = std::hypot(slope, 1.);
    for (const double y : { 0., 1. })
    {
      points->InsertNextPoint(x, y, Amplitude * std::sin(2. * Pi * Waves * x));
      normals->InsertNextTuple3(-slope / length, 0., 1. / length);
    }
    if (i > 0)
    {
      const vtkIdType quad[4] = { 2 * i - 2, 2 * i, 2 * i + 1, 2 * i - 1 };
      cells->InsertNextCell(4, quad);
    }
  }
  vtkNew<vtkPolyData> data;
  data->SetPoints(points);
  data->SetPolys(cells);
  data->GetPointData()->SetNormals(normals);
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputData(data);
  return whiteActor(mapper);
}

/** Ink of a row, 0 to 1 a pixel, from one column to another. */
double ink(const std::vector<unsigned char>& pixels, int width, int row, int from, int to)
{
  double sum = 0.;
  for (int column = std::max(from, 0); column <= std::min(to, width - 1); ++column)
  {
    sum += 1. - pixels[4 * (std::size_t(row) * width + column)] / 255.;
  }
  return sum;
}

enum Kind
{
  Ridges,
  Demarcating,
  Suggestive
};

void testWaves(Suite& suite)
{
  for (const Kind kind : { Ridges, Demarcating, Suggestive })
  {
    for (const int size : { 120, 280 })
    {
      for (const double width : { 1., 3. })
      {
        KBufferScene scene(size, size);
        scene.renderer->SetBackground(1., 1., 1.);
        scene.renderer->AddActor(wavesActor());
        vtkCamera* camera = scene.renderer->GetActiveCamera();
        const double tilt = kind == Suggestive ? 35. : 0.;
        camera->Azimuth(tilt);
        vtkCurvatureOpacityProperty* property = scene.pass->GetCurvatureOpacityProperty();
        property->SetRidgesAndValleys(kind == Ridges);
        property->SetLineThreshold(.02);
        property->SetDemarcatingCurves(kind == Demarcating);
        property->SetSuggestiveContours(kind == Suggestive);
        property->SetLineWidth(width);
        const auto pixels = scene.capture();

        // Crests at odd eighths, inflections at fourths; the middle one is seen best.
        int lines = 0;
        int misses = 0;
        double widest = 0.;
        double thinnest = 1e9;
        const int row = size / 2;
        double expected = 0.;
        for (int eighth = 1; eighth < 8; ++eighth)
        {
          if ((eighth % 2 == 1) != (kind == Ridges))
          {
            continue;
          }
          const double x = eighth / 8.;
          const double z = Amplitude * std::sin(2. * Pi * Waves * x);
          const double angle = tilt * Pi / 180.;
          const double across = (x - .5) * std::cos(angle) - z * std::sin(angle);
          const int column = static_cast<int>(std::floor((across + .5) * size));
          const int reach = static_cast<int>(width) + 2;
          const double here = ink(pixels, size, row, column - reach, column + reach);
          if (here > .25 * width)
          {
            ++lines;
            widest = std::max(widest, here);
            thinnest = std::min(thinnest, here);
          }
          else
          {
            ++misses;
          }
          expected += here;
        }
        const double all = ink(pixels, size, row, size / 10, size - 1 - size / 10);
        const std::string name = std::string(kind == Ridges ? "ridges"
                                     : kind == Demarcating  ? "demarcating curves"
                                                            : "suggestive contours") +
          ", " + std::to_string(size) + " pixels, width " + std::to_string(width) + ": ";
        suite.check(kind == Suggestive ? lines >= 1 && misses >= 1 : misses == 0,
          name + std::to_string(lines) + " lines, " + std::to_string(misses) + " missing", __FILE__,
          __LINE__);
        suite.check(thinnest > .6 * width && widest < 1.4 * width,
          name + "widths from " + std::to_string(thinnest) + " to " + std::to_string(widest),
          __FILE__, __LINE__);
        suite.check(std::abs(all - expected) < .3 * width,
          name + "ink elsewhere: " + std::to_string(all - expected), __FILE__, __LINE__);
      }
    }
  }
  LT_CHECK(suite, openGLErrors().empty());
}

void testContours(Suite& suite)
{
  for (const int size : { 80, 240 })
  {
    for (const bool behind : { false, true })
    {
      const double width = 3.;
      KBufferScene scene(size, size);
      scene.renderer->SetBackground(1., 1., 1.);
      vtkNew<vtkSphereSource> sphere;
      sphere->SetCenter(.5, .5, -1.);
      sphere->SetRadius(.35);
      sphere->SetThetaResolution(150);
      sphere->SetPhiResolution(100);
      vtkNew<vtkPolyDataMapper> mapper;
      mapper->SetInputConnection(sphere->GetOutputPort());
      scene.renderer->AddActor(whiteActor(mapper));
      if (behind)
      {
        // Through four clear layers.
        for (int i = 0; i < 4; ++i)
        {
          Layer clear;
          clear.color = { 1., 1., 1., .001 };
          clear.z = 1. + i;
          scene.add({ clear });
        }
      }
      vtkCurvatureOpacityProperty* property = scene.pass->GetCurvatureOpacityProperty();
      property->OccludingContoursOn();
      property->SetLineWidth(width);
      const auto pixels = scene.capture();
      // Half of the line is outside of the sphere, where there is nothing to draw on.
      const int edge = static_cast<int>(.15 * size);
      const double found = ink(pixels, size, size / 2, edge - 3, edge + 8);
      suite.check(std::abs(found - .5 * width) < .75,
        "contour of " + std::to_string(found) + " pixels, expected " + std::to_string(.5 * width) +
          ", behind " + std::to_string(behind),
        __FILE__, __LINE__);
      LT_CHECK(suite, ink(pixels, size, size / 2, edge + 9, size - edge - 10) < .1);
    }
  }
}
} // namespace

int main(int argc, char* argv[])
{
  if (!canRender())
  {
    return Suite::skipped();
  }
  Suite suite(argc, argv);
  testWaves(suite);
  testContours(suite);
  LT_CHECK(suite, openGLDebugErrors() == 0);
  return suite.result();
}
