// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * A light right of, before and below the middle of a head appears where it
 * should in each slice, whatever the direction matrices of anatomy and light;
 * marks are on the right sides; arrows point away from the source; the legend is
 * there; nothing is made anew when nothing changed; bad input is told once.
 */
#include "LightTransportRenderingTesting.h"

#include "vtkDataArray.h"
#include "vtkDoubleArray.h"
#include "vtkExecutive.h"
#include "vtkFloatArray.h"
#include "vtkImageAlgorithm.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkLightFieldProperty.h"
#include "vtkLightFieldSlices.h"
#include "vtkMath.h"
#include "vtkMatrix3x3.h"
#include "vtkObjectFactory.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"
#include "vtkRenderer.h"
#include "vtkRendererCollection.h"
#include "vtkStreamingDemandDrivenPipeline.h"
#include "vtkTestErrorObserver.h"
#include "vtkTrivialProducer.h"
#include "vtkUnsignedCharArray.h"

#include <functional>
#include <limits>
#include <vector>

using namespace lighttransport::testing;

namespace
{
using Image = vtkSmartPointer<vtkImageData>;
using Function = std::function<double(double x, double y, double z)>;

constexpr double Pi = 3.14159265358979323846;
// In RAS, the patient's axes: right, anterior, superior are positive.
constexpr double Source[3] = { 14., 8., -10. };

/** World columns of the i, j and k axes. */
using Direction = std::array<double, 9>;
const Direction RASAxes = { 1, 0, 0, 0, 1, 0, 0, 0, 1 };
const Direction LPSAxes = { -1, 0, 0, 0, -1, 0, 0, 0, 1 };
// i to the back, j upwards, k to the left: as a sagittal scan has them.
const Direction SagittalAxes = { 0, 0, -1, -1, 0, 0, 0, 1, 0 };

/** An image around the world's origin of the given size (world lengths along i, j, k). */
Image makeImage(const Direction& direction, const std::array<int, 3>& dimensions,
  const std::array<double, 3>& spacing, int firstIndex = 0)
{
  Image image = Image::New();
  const int e = firstIndex;
  image->SetExtent(e, e + dimensions[0] - 1, e, e + dimensions[1] - 1, e, e + dimensions[2] - 1);
  image->SetSpacing(spacing.data());
  image->SetDirectionMatrix(direction.data());
  double middle[3];
  image->TransformContinuousIndexToPhysicalPoint(e + 0.5 * (dimensions[0] - 1),
    e + 0.5 * (dimensions[1] - 1), e + 0.5 * (dimensions[2] - 1), middle);
  image->SetOrigin(-middle[0], -middle[1], -middle[2]);
  return image;
}

void addArray(vtkImageData* image, const char* name, const Function& function)
{
  vtkNew<vtkFloatArray> array;
  array->SetName(name);
  array->SetNumberOfTuples(image->GetNumberOfPoints());
  for (vtkIdType id = 0; id < image->GetNumberOfPoints(); ++id)
  {
    double p[3];
    image->GetPoint(id, p);
    array->SetValue(id, static_cast<float>(function(p[0], p[1], p[2])));
  }
  image->GetPointData()->AddArray(array);
  image->GetPointData()->SetActiveScalars(name);
}

/** An ellipsoid of grey 100, longer from front to back, in nothing. */
double head(double x, double y, double z)
{
  const double r = vtkMath::Norm(std::array<double, 3>{ x / 26., y / 32., z / 28. }.data());
  return r < 1. ? (r < 0.9 ? 100. : 180.) : 0.;
}

double distanceToSource(double x, double y, double z)
{
  return std::sqrt((x - Source[0]) * (x - Source[0]) + (y - Source[1]) * (y - Source[1]) +
    (z - Source[2]) * (z - Source[2]));
}

/** A point source in an infinite medium, cut at half a voxel. */
double fluence(double x, double y, double z)
{
  const double r = std::max(1., distanceToSource(x, y, z));
  return std::exp(-0.5 * r) / (4. * Pi * r);
}

Image makeAnatomy(const Direction& direction)
{
  // 60 x 72 x 64 world units in RAS order; the sagittal scan permutes.
  Image image = direction == SagittalAxes
    ? makeImage(direction, { 72, 32, 40 }, { 1., 2., 1.5 }, 3)
    : makeImage(direction, { 40, 72, 32 }, { 1.5, 1., 2. }, 3);
  addArray(image, "Grey", head);
  return image;
}

Image makeLight(const Direction& direction, const Function& function = fluence)
{
  Image image = direction == SagittalAxes
    ? makeImage(direction, { 36, 32, 30 }, { 2., 2., 2. }, -5)
    : makeImage(direction, { 30, 36, 32 }, { 2., 2., 2. }, -5);
  addArray(image, "Fluence", function);
  vtkNew<vtkDoubleArray> flux;
  flux->SetName("Flux");
  flux->SetNumberOfComponents(3);
  flux->SetNumberOfTuples(image->GetNumberOfPoints());
  for (vtkIdType id = 0; id < image->GetNumberOfPoints(); ++id)
  {
    double p[3];
    image->GetPoint(id, p);
    const double r = std::max(1., distanceToSource(p[0], p[1], p[2]));
    const double e = function(p[0], p[1], p[2]) * (0.5 + 1. / r) / r;
    flux->SetTuple3(id, e * (p[0] - Source[0]), e * (p[1] - Source[1]), e * (p[2] - Source[2]));
  }
  image->GetPointData()->AddArray(flux);
  return image;
}

/** How much of an image's pixels are coloured, by quarter: [right on screen][upper]. */
struct Quarters
{
  double share[2][2] = { { 0., 0. }, { 0., 0. } };
};

Quarters coloredQuarters(vtkImageData* picture)
{
  int d[3];
  picture->GetDimensions(d);
  Quarters quarters;
  for (int y = 0; y < d[1]; ++y)
  {
    for (int x = 0; x < d[0]; ++x)
    {
      const Color c = pixel(picture, x, y);
      if (std::abs(c[0] - c[2]) > 60.)
      {
        quarters.share[2 * x >= d[0] ? 1 : 0][2 * y >= d[1] ? 1 : 0] += 4. / (d[0] * d[1]);
      }
    }
  }
  return quarters;
}

/** That the light is strongest in one quarter, and absent opposite. */
void checkQuarter(Suite& suite, vtkLightFieldSlices* slices, int slice, bool right, bool upper,
  const std::string& what)
{
  const Quarters q = coloredQuarters(slices->GetSliceImage(slice));
  const double here = q.share[right][upper];
  suite.check(here > 0.15 && here > 2. * q.share[!right][upper] &&
      here > 2. * q.share[right][!upper] && q.share[!right][!upper] < 0.1 * here,
    what + ", slice " + std::to_string(slice) + ": coloured shares " +
      std::to_string(q.share[0][0]) + " " + std::to_string(q.share[1][0]) + " below, " +
      std::to_string(q.share[0][1]) + " " + std::to_string(q.share[1][1]) + " above",
    __FILE__, __LINE__);
}

/** Where the light's centre is on screen, from the source's coordinates alone. */
void testPlaces(Suite& suite)
{
  const Direction all[] = { RASAxes, LPSAxes, SagittalAxes };
  const char* names[] = { "RAS", "LPS", "sagittal" };
  for (int a = 0; a < 3; ++a)
  {
    for (int l = 0; l < 3; ++l)
    {
      const std::string what = std::string(names[a]) + " anatomy, " + names[l] + " light";
      vtkNew<vtkLightFieldSlices> slices;
      slices->SetInputData(makeAnatomy(all[a]));
      slices->SetLightFieldData(makeLight(all[l]));
      slices->SetPatientAxes(vtkLightFieldSlices::RAS);
      slices->Update();

      // The position is the light's, on the anatomy's grid.
      const double* position = slices->GetPosition();
      for (int c = 0; c < 3; ++c)
      {
        LT_CHECK_NEAR(suite, position[c], Source[c], 2.01);
      }

      // Radiological: right of the patient is left on screen. The source is
      // right, anterior and inferior; a sagittal slice has anterior on the left.
      suite.check(slices->GetMarks(0) == "RLPA", what + ": axial marks " + slices->GetMarks(0),
        __FILE__, __LINE__);
      suite.check(slices->GetMarks(1) == "RLIS", what + ": coronal marks " + slices->GetMarks(1),
        __FILE__, __LINE__);
      suite.check(slices->GetMarks(2) == "APIS", what + ": sagittal marks " + slices->GetMarks(2),
        __FILE__, __LINE__);
      checkQuarter(suite, slices, 0, false, true, what);
      checkQuarter(suite, slices, 1, false, false, what);
      checkQuarter(suite, slices, 2, false, false, what);

      slices->SetConventionToNeurological();
      slices->Update();
      LT_CHECK(suite, slices->GetMarks(0) == "LRPA");
      LT_CHECK(suite, slices->GetMarks(1) == "LRIS");
      LT_CHECK(suite, slices->GetMarks(2) == "APIS");
      checkQuarter(suite, slices, 0, true, true, what + ", neurological");
      checkQuarter(suite, slices, 1, true, false, what + ", neurological");
      checkQuarter(suite, slices, 2, false, false, what + ", neurological");

      // The same numbers in a world that is LPS are a patient turned round.
      slices->SetConventionToRadiological();
      slices->SetPatientAxes(vtkLightFieldSlices::LPS);
      slices->Update();
      LT_CHECK(suite, slices->GetMarks(0) == "RLPA");
      checkQuarter(suite, slices, 0, true, false, what + ", LPS world");
      checkQuarter(suite, slices, 1, true, false, what + ", LPS world");
      checkQuarter(suite, slices, 2, true, false, what + ", LPS world");
    }
  }

  // An oblique scan: slices follow it, each letter is the nearest one.
  vtkNew<vtkMatrix3x3> turn;
  const double c = std::cos(0.26);
  const double s = std::sin(0.26);
  const double aboutZ[9] = { c, s, 0, -s, c, 0, 0, 0, 1 };
  const double aboutX[9] = { 1, 0, 0, 0, c, -s, 0, s, c };
  Direction oblique;
  vtkMatrix3x3::Multiply3x3(aboutZ, aboutX, oblique.data());
  vtkNew<vtkLightFieldSlices> turned;
  turned->SetInputData(makeAnatomy(oblique));
  turned->SetLightFieldData(makeLight(SagittalAxes));
  turned->SetPatientAxes(vtkLightFieldSlices::RAS);
  turned->ShowArrowsOn();
  turned->Update();
  LT_CHECK(suite, turned->GetMarks(0) == "RLPA");
  LT_CHECK(suite, turned->GetMarks(1) == "RLIS");
  LT_CHECK(suite, turned->GetMarks(2) == "APIS");
  for (int slice = 0; slice < 3; ++slice)
  {
    // Arrows lie in the plane of the slice: its normal is a column of the matrix.
    const int axis = slice == 0 ? 2 : slice == 1 ? 1 : 0;
    const double normal[3] = { oblique[axis], oblique[3 + axis], oblique[6 + axis] };
    vtkPolyData* arrows = turned->GetArrows(slice);
    LT_CHECK(suite, arrows->GetNumberOfPoints() > 100);
    double farthest = 0.;
    for (vtkIdType id = 0; id < arrows->GetNumberOfPoints(); ++id)
    {
      double p[3];
      arrows->GetPoint(id, p);
      const double* position = turned->GetPosition();
      const double toPoint[3] = { p[0] - position[0], p[1] - position[1], p[2] - position[2] };
      farthest = std::max(farthest, std::abs(vtkMath::Dot(toPoint, normal)));
    }
    LT_CHECK(suite, farthest < 1e-9);
  }
  checkQuarter(suite, turned, 0, false, true, "oblique");
  checkQuarter(suite, turned, 1, false, false, "oblique");

  // Nothing known: the volume's own axes, i and j to the right, and no marks.
  vtkNew<vtkLightFieldSlices> slices;
  slices->SetInputData(makeAnatomy(LPSAxes));
  slices->SetLightFieldData(makeLight(RASAxes));
  slices->Update();
  LT_CHECK(suite, slices->GetMarks(0).empty());
  checkQuarter(suite, slices, 0, false, false, "unknown"); // i and j grow to L and P
  checkQuarter(suite, slices, 1, false, false, "unknown");
  checkQuarter(suite, slices, 2, false, false, "unknown"); // j to the right
}

/** The slices agree with the property, pixel by pixel. */
void testColors(Suite& suite)
{
  Image anatomy = makeAnatomy(RASAxes);
  Image light = makeLight(RASAxes);
  vtkNew<vtkLightFieldSlices> slices;
  slices->SetInputData(anatomy);
  slices->SetLightFieldData(light);
  slices->SetWindowLevel(200., 100.);
  slices->SetPosition(Source);
  slices->Update();
  vtkImageData* picture = slices->GetSliceImage(vtkLightFieldSlices::Axial);
  int d[3];
  picture->GetDimensions(d);
  LT_CHECK(suite, d[1] == 256 && d[0] == 213); // 60 : 72, whatever the spacing
  double range[2];
  light->GetPointData()->GetArray("Fluence")->GetRange(range);
  int compared = 0;
  for (const auto& at : { std::array<double, 2>{ 14., 8. }, std::array<double, 2>{ 10., 2. },
         std::array<double, 2>{ 5., 5. }, std::array<double, 2>{ 0., 0. },
         std::array<double, 2>{ -10., 10. }, std::array<double, 2>{ -29., 35. } })
  {
    const int x = static_cast<int>((at[0] + 30.) / 60. * d[0]);
    const int y = static_cast<int>((at[1] + 36.) / 72. * d[1]);
    const double wx = (x + .5) / d[0] * 60. - 30.;
    const double wy = (y + .5) / d[1] * 72. - 36.;
    const double wz = slices->GetPosition()[2];
    // Trilinear by hand, in the light's grid.
    double index[3];
    const double world[3] = { wx, wy, wz };
    light->TransformPhysicalPointToContinuousIndex(world, index);
    double phi = 0.;
    for (int corner = 0; corner < 8; ++corner)
    {
      int ijk[3];
      double weight = 1.;
      for (int axis = 0; axis < 3; ++axis)
      {
        const double low = std::floor(index[axis]);
        const int upper = corner >> axis & 1;
        ijk[axis] = static_cast<int>(low) + upper;
        weight *= upper ? index[axis] - low : 1. - (index[axis] - low);
        ijk[axis] = std::min(
          light->GetExtent()[2 * axis + 1], std::max(light->GetExtent()[2 * axis], ijk[axis]));
      }
      phi +=
        weight * light->GetPointData()->GetArray("Fluence")->GetTuple1(light->ComputePointId(ijk));
    }
    double rgba[4];
    slices->GetLightFieldProperty()->MapValue(phi, range[1], rgba);
    const double grey = head(wx, wy, wz) / 200.; // uniform around these points
    const Color shown = pixel(picture, x, y);
    for (int c = 0; c < 3; ++c)
    {
      LT_CHECK_NEAR(suite, shown[c], 255. * (grey + rgba[3] * (rgba[c] - grey)), 1.6);
      ++compared;
    }
  }
  LT_CHECK(suite, compared == 18);

  // No strength: the anatomy alone. Illuminate: the same as Overlay.
  vtkLightFieldProperty* property = slices->GetLightFieldProperty();
  property->SetStrength(0.);
  slices->Update();
  vtkNew<vtkLightFieldSlices> alone;
  alone->SetInputData(anatomy);
  alone->SetWindowLevel(200., 100.);
  alone->SetPosition(Source);
  alone->Update();
  for (int slice = 0; slice < 3; ++slice)
  {
    LT_CHECK(
      suite, difference(slices->GetSliceImage(slice), alone->GetSliceImage(slice)).largest == 0.);
  }
  property->SetStrength(1.);
  slices->Update();
  Picture overlay = Picture::New();
  overlay->DeepCopy(picture);
  property->SetModeToIlluminate();
  slices->Update();
  LT_CHECK(suite, difference(picture, overlay).largest == 0.);

  const int sx = static_cast<int>((Source[0] + 30.) / 60. * d[0]);
  const int sy = static_cast<int>((Source[1] + 36.) / 72. * d[1]);
  // FluxDirection: right of the source the flux goes along x, so it is red.
  property->SetModeToFluxDirection();
  slices->Update();
  const Color red = pixel(picture, sx + 20, sy);
  LT_CHECK(suite, red[0] > 1.5 * red[1] && red[0] > 1.5 * red[2]);
  const Color green = pixel(picture, sx, sy + 20);
  LT_CHECK(suite, green[1] > 1.5 * green[0] && green[1] > 1.5 * green[2]);
}

/** Arrows: away from the source, straight, long near it, inside the slice. */
void testArrows(Suite& suite)
{
  for (const Direction& direction : { RASAxes, SagittalAxes })
  {
    vtkNew<vtkLightFieldSlices> slices;
    slices->SetInputData(makeAnatomy(RASAxes));
    slices->SetLightFieldData(makeLight(direction));
    slices->SetPatientAxes(vtkLightFieldSlices::RAS);
    slices->SetPosition(Source);
    slices->Update();
    LT_CHECK(suite, slices->GetArrows(0)->GetNumberOfPoints() == 0); // off by default
    slices->ShowArrowsOn();
    slices->Update();
    for (int slice = 0; slice < 3; ++slice)
    {
      vtkPolyData* arrows = slices->GetArrows(slice);
      const vtkIdType count = arrows->GetNumberOfPoints() / 4;
      LT_CHECK(suite, count > 60 && arrows->GetNumberOfLines() == count);
      LT_CHECK(suite, arrows->GetNumberOfPolys() == count);
      const int normal = slice == 0 ? 2 : slice == 1 ? 1 : 0;
      double longest = 0.;
      double longestAt = 0.;
      int wrong = 0;
      for (vtkIdType n = 0; n < count; ++n)
      {
        double tail[3];
        double tip[3];
        arrows->GetPoint(4 * n, tail);
        arrows->GetPoint(4 * n + 1, tip);
        double along[3];
        double fromSource[3];
        for (int c = 0; c < 3; ++c)
        {
          along[c] = tip[c] - tail[c];
          fromSource[c] = 0.5 * (tip[c] + tail[c]) - Source[c];
        }
        wrong += std::abs(along[normal]) > 1e-9 ? 1 : 0; // in the plane
        fromSource[normal] = 0.;
        const double length = vtkMath::Norm(along);
        const double distance = vtkMath::Norm(fromSource);
        if (length > longest)
        {
          longest = length;
          longestAt = distance;
        }
        // Trilinear flux is coarse next to the source.
        if (distance > 4. && vtkMath::Dot(along, fromSource) < 0.97 * length * distance)
        {
          ++wrong;
        }
      }
      LT_CHECK(suite, wrong == 0);
      LT_CHECK(suite, longestAt < 8.);
      LT_CHECK(suite, longest < 72. / 20.); // its cell
    }
    slices->SetArrowLength(vtkLightFieldSlices::UniformLength);
    slices->Update();
    double a[3];
    double b[3];
    slices->GetArrows(0)->GetPoint(0, a);
    slices->GetArrows(0)->GetPoint(1, b);
    LT_CHECK_NEAR(suite, std::sqrt(vtkMath::Distance2BetweenPoints(a, b)), 0.9 * 72. / 20., 1e-9);
  }
}

bool hasText(vtkImageData* picture, int x0, int y0, int x1, int y1)
{
  double brightest = 0.;
  for (int y = y0; y <= y1; ++y)
  {
    for (int x = x0; x <= x1; ++x)
    {
      brightest = std::max(brightest, pixel(picture, x, y)[1]);
    }
  }
  return brightest > 200.;
}

/** In a window: layout, marks, legend, picking; and nothing is done twice. */
void testWindow(Suite& suite)
{
  vtkNew<vtkTrivialProducer> producer;
  Image anatomy = makeAnatomy(LPSAxes);
  producer->SetOutput(anatomy);
  Image light = makeLight(SagittalAxes);
  vtkNew<vtkLightFieldSlices> slices;
  slices->SetInputConnection(producer->GetOutputPort());
  slices->SetLightFieldData(light);
  slices->SetPatientAxes(vtkLightFieldSlices::RAS);
  slices->SetLengthUnits("mm");
  vtkNew<vtkRenderWindow> window;
  window->SetSize(300, 300);
  slices->AddToRenderWindow(window);
  Picture picture = capture(window);
  LT_CHECK(suite, openGLErrors().empty());
  LT_CHECK(suite, slices->GetNumberOfBuilds() == 1);
  compareWithBaseline(suite, picture, "LightFieldSlicesGrid");

  // Every slice has the same scale, in both directions: 10 pixels apart on screen
  // are the same distance anywhere.
  std::vector<double> distances;
  for (int slice = 0; slice < 3; ++slice)
  {
    const double* viewport = slices->GetSliceRenderer(slice)->GetViewport();
    const double x = 150. * (viewport[0] + viewport[2]);
    const double y = 150. * (viewport[1] + viewport[3]);
    double a[3];
    double b[3];
    double c[3];
    LT_CHECK(suite, slices->DisplayToWorld(x, y, a));
    LT_CHECK(suite, slices->DisplayToWorld(x + 10., y, b));
    LT_CHECK(suite, slices->DisplayToWorld(x, y + 10., c));
    distances.push_back(std::sqrt(vtkMath::Distance2BetweenPoints(a, b)));
    distances.push_back(std::sqrt(vtkMath::Distance2BetweenPoints(a, c)));
  }
  for (const double distance : distances)
  {
    LT_CHECK_CLOSE(suite, distance, distances[0], 1e-9);
  }
  double nowhere[3];
  LT_CHECK(suite, !slices->DisplayToWorld(299., 299., nowhere)); // the legend
  LT_CHECK(suite, !slices->DisplayToWorld(-5., 10., nowhere));

  // The pixel over the source, found through DisplayToWorld, shows the light's colour.
  double best = 1e9;
  int bestX = 0;
  int bestY = 0;
  for (int y = 0; y < 300; ++y)
  {
    for (int x = 0; x < 300; ++x)
    {
      double world[3];
      if (slices->DisplayToWorld(x, y, world) &&
        vtkMath::Distance2BetweenPoints(world, Source) < best)
      {
        best = vtkMath::Distance2BetweenPoints(world, Source);
        bestX = x;
        bestY = y;
      }
    }
  }
  const Color core = regionMean(picture, bestX - 1, bestY - 1, bestX + 1, bestY + 1);
  LT_CHECK(suite, core[0] > 180. && core[0] > core[2] + 40.);

  // The legend's bar: pale at the top, dark at the bottom, and text beside it.
  const double* viewport = slices->GetLegendRenderer()->GetViewport();
  const int left = static_cast<int>(300 * viewport[0]);
  const int bottom = static_cast<int>(300 * viewport[1]);
  const int top = static_cast<int>(300 * viewport[3]) - 1;
  const Color high = regionMean(picture, left + 10, top - 14, left + 14, top - 12);
  const Color low = regionMean(picture, left + 10, bottom + 12, left + 14, bottom + 14);
  LT_CHECK(suite, high[0] > low[0] + 100. && high[1] > low[1] + 100.);
  LT_CHECK(suite, hasText(picture, left + 24, bottom + 10, left + 40, top - 10));

  // Marks: there, and gone with ShowMarks off. The left edge of the coronal slice.
  slices->ShowMarksOff();
  slices->ShowCaptionsOff();
  slices->ShowCrosshairOff();
  const Picture plain = capture(window);
  LT_CHECK(suite, difference(plain, picture).largest > 100.);
  slices->ShowMarksOn();
  slices->ShowCaptionsOn();
  slices->ShowCrosshairOn();
  LT_CHECK(suite, difference(capture(window), picture).largest == 0.);

  // Nothing changed, nothing made; each change is noticed once.
  const int builds = slices->GetNumberOfBuilds();
  const vtkMTimeType pictureTime = slices->GetSliceImage(0)->GetMTime();
  for (int n = 0; n < 3; ++n)
  {
    window->Render();
  }
  LT_CHECK(suite, slices->GetNumberOfBuilds() == builds);
  LT_CHECK(suite, slices->GetSliceImage(0)->GetMTime() == pictureTime);
  window->SetSize(280, 240); // a new size moves things, but samples nothing
  window->Render();
  LT_CHECK(suite, slices->GetNumberOfBuilds() == builds);
  LT_CHECK(suite, slices->GetSliceImage(0)->GetMTime() == pictureTime);
  window->SetSize(300, 300);
  LT_CHECK(suite, difference(capture(window), picture).largest == 0.);
  slices->GetLightFieldProperty()->SetDecades(4.);
  window->Render();
  LT_CHECK(suite, slices->GetNumberOfBuilds() == builds + 1);
  light->GetPointData()->GetArray("Fluence")->SetTuple1(0, 1e-3);
  light->GetPointData()->GetArray("Fluence")->Modified();
  window->Render();
  LT_CHECK(suite, slices->GetNumberOfBuilds() == builds + 2);
  slices->SetPosition(0., 0., 0.);
  window->Render();
  slices->SetPosition(0., 0., 0.);
  window->Render();
  LT_CHECK(suite, slices->GetNumberOfBuilds() == builds + 3);

  // Zoomed in, the position is in the middle of each slice's box, and lit.
  slices->GetLightFieldProperty()->SetDecades(6.);
  slices->SetPosition(Source);
  slices->SetZoom(3.);
  const Picture zoomed = capture(window);
  for (int slice = 0; slice < 3; ++slice)
  {
    const double* part = slices->GetSliceRenderer(slice)->GetViewport();
    const double x = 150. * (part[0] + part[2]) - 0.5;
    const double y = 150. * (part[1] + part[3]) - 0.5;
    double world[3];
    LT_CHECK(suite, slices->DisplayToWorld(x, y, world));
    for (int c = 0; c < 3; ++c)
    {
      LT_CHECK_NEAR(suite, world[c], slices->GetPosition()[c], 1e-9);
    }
    const int u = static_cast<int>(x);
    const int v = static_cast<int>(y);
    const Color lit = regionMean(zoomed, u - 5, v - 5, u + 5, v + 5);
    LT_CHECK(suite, lit[0] > lit[2] + 60.);
  }
  writePicture(suite, zoomed, "LightFieldSlicesZoomed");
  slices->SetZoom(1.);

  // Moved to a part of another window; the first one is empty again.
  vtkNew<vtkRenderWindow> other;
  other->SetSize(300, 160);
  slices->ClearPosition();
  slices->ShowArrowsOn();
  slices->AddToRenderWindow(other, 0., 0.1, 1., 1.);
  const Picture row = capture(other);
  LT_CHECK(suite, window->GetRenderers()->GetNumberOfItems() == 0);
  compareWithBaseline(suite, row, "LightFieldSlicesRow");
  LT_CHECK(suite, openGLErrors().empty());
  slices->RemoveFromRenderWindow();
  LT_CHECK(suite, other->GetRenderers()->GetNumberOfItems() == 0);
}

/** Both signs: two colour maps on the slice, two bars in the legend. */
void testSigned(Suite& suite)
{
  Image light = makeLight(RASAxes,
    [](double x, double y, double z) { return fluence(x, y, z) - 0.3 * fluence(x + 24., y, z); });
  vtkNew<vtkLightFieldSlices> slices;
  slices->SetInputData(makeAnatomy(RASAxes));
  slices->SetLightFieldData(light);
  slices->SetPatientAxes(vtkLightFieldSlices::RAS);
  slices->SetFluenceUnits("W/mm\xc2\xb2");
  slices->SetLayout(vtkLightFieldSlices::Row);
  vtkNew<vtkRenderWindow> window;
  window->SetSize(300, 140);
  slices->AddToRenderWindow(window);
  const Picture picture = capture(window);
  compareWithBaseline(suite, picture, "LightFieldSlicesSigned");
  vtkImageData* axial = slices->GetSliceImage(0);
  int d[3];
  axial->GetDimensions(d);
  const auto at = [&](double x, double y)
  {
    const int u = static_cast<int>((30. - x) / 60. * d[0]); // radiological
    const int v = static_cast<int>((y + 36.) / 72. * d[1]);
    return regionMean(axial, u - 1, v - 1, u + 1, v + 1);
  };
  const Color positive = at(Source[0], Source[1]);
  const Color negative = at(Source[0] - 24., Source[1]);
  LT_CHECK(suite, positive[0] > positive[2] + 40.);
  LT_CHECK(suite, negative[2] > negative[0] + 40.);
  LT_CHECK_NEAR(suite, slices->GetPosition()[0], Source[0], 1.01); // the positive one

  // A solver's undershoot gets no bar: the picture is that of the positive light.
  slices->SetLightFieldData(makeLight(RASAxes));
  const Picture positiveOnly = capture(window);
  slices->SetLightFieldData(makeLight(RASAxes,
    [](double x, double y, double z)
    { return fluence(x, y, z) > 1e-9 ? fluence(x, y, z) : -1e-9; }));
  LT_CHECK(suite, difference(capture(window), positiveOnly).largest == 0.);
  LT_CHECK(suite, difference(positiveOnly, picture).largest > 100.);
}

/** Odd volumes and odd values. */
void testCorners(Suite& suite)
{
  vtkNew<vtkRenderWindow> window;
  window->SetSize(150, 150);
  vtkNew<vtkLightFieldSlices> slices;
  slices->AddToRenderWindow(window);
  vtkNew<vtkTest::ErrorObserver> errors;
  slices->AddObserver(vtkCommand::ErrorEvent, errors);

  // One slice, one row, one voxel.
  for (const auto& dimensions : { std::array<int, 3>{ 20, 16, 1 }, std::array<int, 3>{ 20, 1, 1 },
         std::array<int, 3>{ 1, 1, 1 } })
  {
    Image thin = makeImage(RASAxes, dimensions, { 1., 1., 1. });
    addArray(thin, "Grey", [](double, double, double) { return 7.; });
    addArray(thin, "Fluence", [](double, double, double) { return 2.; });
    thin->GetPointData()->SetActiveScalars("Grey");
    slices->SetInputData(thin);
    slices->SetLightFieldData(thin);
    const Picture picture = capture(window);
    LT_CHECK(suite, !errors->GetError());
    double rgba[4];
    slices->GetLightFieldProperty()->MapValue(2., 2., rgba);
    const Color middle = pixel(slices->GetSliceImage(0), 0, 0);
    LT_CHECK_NEAR(suite, middle[0], 255. * (0.5 + rgba[3] * (rgba[0] - 0.5)), 1.01);
  }

  // Windows of few pixels.
  for (const auto& size : { std::array<int, 2>{ 1, 1 }, std::array<int, 2>{ 7, 5 },
         std::array<int, 2>{ 150, 3 }, std::array<int, 2>{ 150, 150 } })
  {
    window->SetSize(size[0], size[1]);
    window->Render();
    LT_CHECK(suite, openGLErrors().empty() && !errors->GetError());
  }

  // NaN in the anatomy is black, and spoils neither neighbours nor the window.
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Image holed = makeImage(RASAxes, { 16, 16, 16 }, { 1., 1., 1. });
  addArray(holed, "Grey",
    [nan](double x, double y, double) {
      return x < -4. ? nan : y > 4. ? std::numeric_limits<double>::infinity() : 50. + y;
    });
  slices->SetInputData(holed);
  slices->SetLightFieldConnection(nullptr);
  slices->SetPosition(0., 0., 0.);
  window->Render();
  LT_CHECK(suite, !errors->GetError());
  vtkImageData* axial = slices->GetSliceImage(0);
  LT_CHECK(suite, regionMean(axial, 0, 0, 60, 255)[0] == 0.);
  LT_CHECK_NEAR(suite, slices->GetColorLevel(), 48., 0.6);
  LT_CHECK(suite, regionMean(axial, 80, 170, 255, 190)[0] > 240.); // below the infinite part
  LT_CHECK(suite, regionMean(axial, 80, 0, 255, 10)[0] < 30.);

  // All NaN, and constant: no light, no crash.
  Image nothing = makeImage(RASAxes, { 4, 4, 4 }, { 1., 1., 1. });
  addArray(nothing, "Grey", [nan](double, double, double) { return nan; });
  slices->SetInputData(nothing);
  window->Render();
  LT_CHECK(suite, regionMean(slices->GetSliceImage(0), 0, 0, 255, 255)[0] == 0.);

  // Colours are shown as they are, without a window.
  Image colors = makeImage(RASAxes, { 8, 8, 8 }, { 1., 1., 1. });
  colors->AllocateScalars(VTK_UNSIGNED_CHAR, 3);
  for (vtkIdType id = 0; id < colors->GetNumberOfPoints(); ++id)
  {
    colors->GetPointData()->GetScalars()->SetTuple3(id, 200., 100., 50.);
  }
  slices->SetInputData(colors);
  window->Render();
  const Color color = regionMean(slices->GetSliceImage(1), 0, 0, 255, 255);
  LT_CHECK(suite, color[0] == 200. && color[1] == 100. && color[2] == 50.);
  LT_CHECK(suite, !errors->GetError());

  // A light that is zero, or NaN in places, is no light there.
  Image dark = makeImage(RASAxes, { 8, 8, 8 }, { 1., 1., 1. });
  addArray(dark, "Fluence", [nan](double x, double, double) { return x < 0. ? nan : 0.; });
  slices->SetLightFieldData(dark);
  window->Render();
  LT_CHECK(suite, !errors->GetError());
  LT_CHECK(suite, regionMean(slices->GetSliceImage(1), 0, 0, 255, 255)[0] == 200.);
}

/** Renders twice: the error comes once, says what was expected, and names the subject. */
void checkError(Suite& suite, vtkRenderWindow* window, vtkTest::ErrorObserver* errors,
  const std::string& subject, int line)
{
  errors->Clear();
  window->Render();
  const std::string message = errors->GetErrorMessage();
  suite.check(errors->GetError() && message.find(subject) != std::string::npos &&
      message.find("expected:") != std::string::npos,
    "error about " + subject + ": " + message, __FILE__, line);
  errors->Clear();
  window->Render();
  suite.check(!errors->GetError(), "told twice: " + subject, __FILE__, line);
}

/** A light field whose making can fail. */
class FailingSource : public vtkImageAlgorithm
{
public:
  static FailingSource* New();
  vtkTypeMacro(FailingSource, vtkImageAlgorithm);
  bool Fails = true;
  int Runs = 0;

protected:
  FailingSource() { this->SetNumberOfInputPorts(0); }
  int RequestInformation(
    vtkInformation*, vtkInformationVector**, vtkInformationVector* out) override
  {
    out->GetInformationObject(0)->Set(
      vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT(), makeLight(RASAxes)->GetExtent(), 6);
    return 1;
  }
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector* out) override
  {
    ++this->Runs;
    if (this->Fails)
    {
      vtkErrorMacro("This always fails.");
      return 0;
    }
    vtkImageData::GetData(out)->ShallowCopy(makeLight(RASAxes));
    return 1;
  }
};
vtkStandardNewMacro(FailingSource);

void testErrors(Suite& suite)
{
  vtkNew<vtkRenderWindow> window;
  window->SetSize(100, 100);
  vtkNew<vtkLightFieldSlices> slices;
  vtkNew<vtkTest::ErrorObserver> errors;
  slices->AddObserver(vtkCommand::ErrorEvent, errors);
  slices->AddToRenderWindow(window);

  checkError(suite, window, errors, "anatomy (input port 0) is empty", __LINE__);
  vtkNew<vtkImageData> empty;
  slices->SetInputData(empty);
  checkError(suite, window, errors, "anatomy (input port 0) is empty", __LINE__);
  Image bare = makeImage(RASAxes, { 4, 4, 4 }, { 1., 1., 1. });
  slices->SetInputData(bare);
  checkError(suite, window, errors, "no point scalars", __LINE__);
  Image flat = makeAnatomy(RASAxes);
  flat->SetSpacing(1., 0., 1.);
  slices->SetInputData(flat);
  checkError(suite, window, errors, "spacing 0", __LINE__);
  slices->SetInputData(makeAnatomy(RASAxes));
  slices->SetComponent(1);
  checkError(suite, window, errors, "Component is 1", __LINE__);
  slices->SetComponent(0);
  slices->SetPatientAxes(3);
  checkError(suite, window, errors, "PatientAxes is 3", __LINE__);
  // Nothing is shown of it all: the background.
  const Color mean = regionMean(capture(window), 0, 0, 99, 99);
  LT_CHECK(suite, mean[0] == 64. && mean[1] == 64.);

  // A bad light leaves the anatomy.
  slices->SetPatientAxes(vtkLightFieldSlices::Unknown);
  slices->SetLightFieldData(empty);
  checkError(suite, window, errors, "light field (input port 1) is empty", __LINE__);
  Image unnamed = makeImage(RASAxes, { 4, 4, 4 }, { 1., 1., 1. });
  addArray(unnamed, "Light", fluence);
  slices->SetLightFieldData(unnamed);
  checkError(suite, window, errors, "Fluence is missing", __LINE__);
  Image noFlux = makeImage(RASAxes, { 30, 36, 32 }, { 2., 2., 2. });
  addArray(noFlux, "Fluence", fluence);
  slices->SetLightFieldData(noFlux);
  slices->ShowArrowsOn();
  checkError(suite, window, errors, "Flux is missing", __LINE__);
  LT_CHECK(suite, coloredQuarters(slices->GetSliceImage(0)).share[1][1] > 0.1); // the fluence
  slices->ShowArrowsOff();

  // A pipeline that fails has said why: it is not asked again until it changes,
  // and the slices add nothing.
  vtkNew<FailingSource> failing;
  failing->AddObserver(vtkCommand::ErrorEvent, errors);
  failing->GetExecutive()->AddObserver(vtkCommand::ErrorEvent, errors);
  vtkNew<vtkTest::ErrorObserver> own;
  slices->AddObserver(vtkCommand::ErrorEvent, own);
  slices->SetLightFieldConnection(failing->GetOutputPort());
  window->Render();
  window->Render();
  LT_CHECK(suite, failing->Runs == 1 && !own->GetError());
  LT_CHECK(suite, coloredQuarters(slices->GetSliceImage(0)).share[1][1] == 0.);
  failing->Modified();
  window->Render();
  LT_CHECK(suite, failing->Runs == 2);
  failing->Fails = false;
  failing->Modified();
  window->Render();
  LT_CHECK(suite, failing->Runs == 3 && !own->GetError());
  LT_CHECK(suite, coloredQuarters(slices->GetSliceImage(0)).share[1][1] > 0.1);

  // Setters.
  errors->Clear();
  slices->SetPosition(std::numeric_limits<double>::quiet_NaN(), 0., 0.);
  LT_CHECK(suite, errors->GetErrorMessage().find("Position") != std::string::npos);
  errors->Clear();
  slices->SetWindowLevel(std::numeric_limits<double>::infinity(), 0.);
  LT_CHECK(suite, errors->GetErrorMessage().find("Window") != std::string::npos);
  errors->Clear();
  slices->SetZoom(0.5);
  LT_CHECK(suite, errors->GetErrorMessage().find("Zoom is 0.5") != std::string::npos);
  errors->Clear();
  slices->AddToRenderWindow(window, 0.5, 0., 0.5, 1.);
  LT_CHECK(suite, errors->GetErrorMessage().find("rectangle") != std::string::npos);
  LT_CHECK(suite, slices->GetRenderWindow() == nullptr);
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  if (!canRender())
  {
    return Suite::skipped();
  }
  testPlaces(suite);
  testColors(suite);
  testArrows(suite);
  testWindow(suite);
  testSigned(suite);
  testCorners(suite);
  testErrors(suite);
  return suite.result();
}
