// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Pictures.h"

#include "VtkErrors.h"

#include "vtkLightFieldProperty.h"
#include "vtkLightFieldSlices.h"
#include "vtkLightTransportArrays.h"
#include "vtkLightTransportEGLRenderWindow.h"
#include "vtkLightTransportVolumeMapper.h"
#include "vtkVolumeLightingProperty.h"

#include "vtkAnnotatedCubeActor.h"
#include "vtkCamera.h"
#include "vtkDataArray.h"
#include "vtkFloatArray.h"
#include "vtkLight.h"
#include "vtkLookupTable.h"
#include "vtkMath.h"
#include "vtkPNGWriter.h"
#include "vtkPointData.h"
#include "vtkProperty.h"
#include "vtkProperty2D.h"
#include "vtkRenderWindow.h"
#include "vtkRenderer.h"
#include "vtkScalarBarActor.h"
#include "vtkTextActor.h"
#include "vtkTextProperty.h"
#include "vtkTexture.h"
#include "vtkVolume.h"
#include "vtkVolumeProperty.h"
#include "vtkWindowToImageFilter.h"

#include <algorithm>
#include <cmath>

namespace lightvolume
{
namespace
{
// The image with every sample that holds no data replaced by `value`; itself where none is.
vtkSmartPointer<vtkImageData> WithoutHoles(
  const Volume& volume, const Statistics& statistics, double value)
{
  if (statistics.NoDataFraction == 0.)
  {
    return volume.Image;
  }
  vtkDataArray* scalars = volume.Image->GetPointData()->GetScalars();
  vtkSmartPointer<vtkDataArray> filled;
  filled.TakeReference(scalars->NewInstance());
  filled->DeepCopy(scalars);
  for (vtkIdType i = 0; i < filled->GetNumberOfTuples(); ++i)
  {
    const double v = filled->GetComponent(i, 0);
    if (!std::isfinite(v) ||
      std::find(volume.NoData.begin(), volume.NoData.end(), v) != volume.NoData.end())
    {
      filled->SetComponent(i, 0, value);
    }
  }
  auto image = vtkSmartPointer<vtkImageData>::New();
  image->CopyStructure(volume.Image);
  image->GetPointData()->SetScalars(filled);
  return image;
}

void Shift(vtkImageData* image, const double by[3])
{
  double origin[3];
  image->GetOrigin(origin);
  image->SetOrigin(origin[0] + by[0], origin[1] + by[1], origin[2] + by[2]);
}

void StyleText(vtkTextActor* actor, int size, double grey, bool bold)
{
  vtkTextProperty* text = actor->GetTextProperty();
  text->SetFontFamilyToArial();
  text->SetFontSize(size);
  text->SetColor(grey, grey, grey);
  text->SetBold(bold);
  text->SetLineSpacing(1.25);
}
/** A studio: brightest above, a soft box where the key light comes from, dim below. */
vtkSmartPointer<vtkTexture> MakeSky(const double up[3], const double key[3])
{
  constexpr int width = 64;
  constexpr int height = 32;
  vtkNew<vtkFloatArray> radiance;
  radiance->SetNumberOfComponents(3);
  radiance->SetNumberOfTuples(width * height);
  for (int y = 0; y < height; ++y)
  {
    const double theta = vtkMath::Pi() * (y + .5) / height;
    for (int x = 0; x < width; ++x)
    {
      // VTK's equirectangular maps: the first row is straight down, the middle column +x.
      const double phi = vtkMath::Pi() * (2. * (x + .5) / width - 1.);
      const double d[3] = { std::sin(theta) * std::cos(phi), -std::cos(theta),
        std::sin(theta) * std::sin(phi) };
      const double high = .5 + .5 * vtkMath::Dot(d, up);
      const double box = std::pow(std::max(vtkMath::Dot(d, key), 0.), 6.);
      radiance->SetTuple3(y * width + x, .25 + .55 * high + 1.5 * box, .26 + .6 * high + 1.42 * box,
        .3 + .68 * high + 1.25 * box);
    }
  }
  vtkNew<vtkImageData> image;
  image->SetDimensions(width, height, 1);
  image->GetPointData()->SetScalars(radiance);
  auto sky = vtkSmartPointer<vtkTexture>::New();
  sky->SetInputData(image);
  sky->SetColorModeToDirectScalars();
  return sky;
}
} // namespace

struct Pictures::Parts
{
  const Volume* TheVolume = nullptr;
  const Options* TheOptions = nullptr;
  vtkSmartPointer<vtkImageData> Shown;
  vtkSmartPointer<vtkImageData> Light;
  double Recentre[3] = { 0., 0., 0. };
  std::array<double, 3> SlicePosition = { { 0, 0, 0 } };

  vtkNew<vtkRenderWindow> Window;
  vtkNew<vtkRenderer> Scene;
  vtkNew<vtkRenderer> Corner;
  vtkNew<vtkLightTransportVolumeMapper> Mapper;
  vtkNew<vtkVolume> Prop;
  vtkNew<vtkLightFieldProperty> Property;
  vtkNew<vtkVolumeLightingProperty> Lighting;
  vtkNew<vtkTextActor> Title;
  vtkNew<vtkTextActor> Caption;
  vtkNew<vtkScalarBarActor> Bar;
  vtkNew<vtkLookupTable> BarColors;
  vtkNew<vtkScalarBarActor> NegativeBar;
  vtkNew<vtkLookupTable> NegativeColors;
  vtkNew<vtkLightFieldSlices> Slices;
  std::string CaptionText;
  VtkErrors Errors;

  void PlaceCamera(const Options& options);
  void PlaceLights(const std::string& kind);
  bool StyleBar(vtkScalarBarActor* bar, vtkLookupTable* colors, double sign, double extreme);
  void ShowLegend(bool on);
};

std::string Pictures::WhyNot()
{
  return vtkLightTransportEGLRenderWindow::IsAvailable()
    ? std::string()
    : vtkLightTransportEGLRenderWindow::GetReasonUnavailable();
}

Pictures::Pictures(
  const Volume& volume, const Statistics& statistics, const Look& look, const Options& options)
{
  // The program shows nothing on a screen: it never needs one.
  vtkLightTransportEGLRenderWindow::UseForAllWindows();
  this->P = std::make_unique<Parts>();
  Parts& p = *this->P;
  p.TheVolume = &volume;
  p.TheOptions = &options;

  // What is not there is drawn with the value that is least seen.
  double least = statistics.Minimum;
  double opacity = look.Opacity->GetValue(least);
  for (int i = 0; i < look.Opacity->GetSize(); ++i)
  {
    double node[4];
    look.Opacity->GetNodeValue(i, node);
    if (node[1] < opacity)
    {
      least = node[0];
      opacity = node[1];
    }
  }
  p.Shown = WithoutHoles(volume, statistics, least);

  // Survey coordinates, millions of metres, are more than a GPU's floats can hold.
  double center[3];
  p.Shown->GetCenter(center);
  const double diagonal = p.Shown->GetLength();
  if (vtkMath::Norm(center) > 20. * diagonal)
  {
    for (int a = 0; a < 3; ++a)
    {
      p.Recentre[a] = -center[a];
    }
    auto moved = vtkSmartPointer<vtkImageData>::New();
    moved->ShallowCopy(p.Shown);
    Shift(moved, p.Recentre);
    p.Shown = moved;
  }

  p.Window->SetOffScreenRendering(1);
  p.Window->SetMultiSamples(0);
  p.Window->SetSize(options.Size[0], options.Size[1]);
  p.Errors.Watch(p.Window);
  p.Errors.Watch(p.Mapper);
  p.Errors.Watch(p.Slices);

  double spacing[3];
  p.Shown->GetSpacing(spacing);
  p.Mapper->SetInputData(p.Shown);
  p.Mapper->SetLightFieldProperty(p.Property);
  p.Mapper->SetAutoAdjustSampleDistances(0);
  p.Mapper->SetLockSampleDistanceToInputSpacing(0);
  p.Mapper->SetSampleDistance(
    static_cast<float>(.6 * std::min({ spacing[0], spacing[1], spacing[2] })));
  p.Mapper->UseJitteringOn(); // no rings of equal depth

  vtkVolumeProperty* property = p.Prop->GetProperty();
  property->SetColor(look.Color);
  property->SetScalarOpacity(look.Opacity);
  if (look.GradientOpacity)
  {
    property->SetGradientOpacity(look.GradientOpacity);
  }
  // Opacities of the presets are per fiftieth of the diagonal's hundredth or so: a voxel of a
  // usual volume, whatever the unit.
  property->SetScalarOpacityUnitDistance(diagonal / 250.);
  property->SetInterpolationTypeToLinear();
  property->SetShade(look.Shade);
  property->SetAmbient(.25);
  property->SetDiffuse(.8);
  property->SetSpecular(.15);
  property->SetSpecularPower(20.);
  p.Prop->SetMapper(p.Mapper);

  p.Property->SetDecades(options.Decades);
  p.Property->SetStrength(options.Strength);
  p.Property->SetLightOpacity(look.LightOpacity);
  p.Property->SetLightOpacityUnitDistance(diagonal / 100.);
  p.Property->SetTissueOpacity(look.TissueOpacity);

  p.Scene->AddVolume(p.Prop);
  p.Scene->GradientBackgroundOn();
  p.Scene->SetBackground(.03, .035, .045);
  p.Scene->SetBackground2(.11, .12, .145);
  p.Scene->SetLayer(0);
  p.Window->SetNumberOfLayers(2);
  p.Window->AddRenderer(p.Scene);
  p.PlaceCamera(options);

  const int height = options.Size[1];
  const int small = std::clamp(height / 44, 8, 40);
  const int margin = std::max(4, height / 48);
  StyleText(p.Title, std::clamp(height / 30, 9, 60), .95, true);
  p.Title->GetTextProperty()->SetVerticalJustificationToTop();
  p.Title->SetPosition(margin, height - margin);
  StyleText(p.Caption, small, .75, false);
  p.Caption->SetPosition(margin, margin);
  p.Title->SetInput(options.Title.c_str());
  p.Scene->AddActor2D(p.Title);
  p.Scene->AddActor2D(p.Caption);
  p.Scene->AddActor2D(p.Bar);
  p.Scene->AddActor2D(p.NegativeBar);

  // Which way the patient looks, or the axes.
  vtkNew<vtkAnnotatedCubeActor> cube;
  cube->SetXPlusFaceText(volume.IsRAS ? "R" : "x");
  cube->SetXMinusFaceText(volume.IsRAS ? "L" : "-x");
  cube->SetYPlusFaceText(volume.IsRAS ? "A" : "y");
  cube->SetYMinusFaceText(volume.IsRAS ? "P" : "-y");
  cube->SetZPlusFaceText(volume.IsRAS ? "S" : "z");
  cube->SetZMinusFaceText(volume.IsRAS ? "I" : "-z");
  cube->SetXFaceTextRotation(0);
  cube->SetZFaceTextRotation(volume.IsRAS ? -90 : 90);
  cube->SetFaceTextScale(.62);
  cube->GetCubeProperty()->SetColor(.35, .38, .42);
  cube->GetTextEdgesProperty()->SetColor(.1, .1, .1);
  cube->SetTextEdgesVisibility(0);
  for (vtkProperty* face :
    { cube->GetXPlusFaceProperty(), cube->GetXMinusFaceProperty(), cube->GetYPlusFaceProperty(),
      cube->GetYMinusFaceProperty(), cube->GetZPlusFaceProperty(), cube->GetZMinusFaceProperty() })
  {
    face->SetColor(1., 1., 1.);
    face->SetInterpolationToFlat();
  }
  p.Corner->AddActor(cube);
  p.Corner->SetLayer(1);
  p.Corner->InteractiveOff();
  const double aspect = static_cast<double>(options.Size[0]) / options.Size[1];
  p.Corner->SetViewport(0., .12, .12 / aspect * 1.25, .27);
  vtkCamera* from = p.Scene->GetActiveCamera();
  double direction[3];
  from->GetDirectionOfProjection(direction);
  vtkCamera* camera = p.Corner->GetActiveCamera();
  camera->SetFocalPoint(0., 0., 0.);
  camera->SetPosition(-direction[0], -direction[1], -direction[2]);
  camera->SetViewUp(from->GetViewUp());
  p.Corner->ResetCamera();
  p.Window->AddRenderer(p.Corner);
}

Pictures::~Pictures() = default;

void Pictures::Parts::PlaceCamera(const Options& options)
{
  const double azimuth =
    vtkMath::RadiansFromDegrees(options.Camera.empty() ? 35. : options.Camera[0]);
  const double elevation =
    vtkMath::RadiansFromDegrees(options.Camera.empty() ? 20. : options.Camera[1]);
  const double zoom = options.Camera.size() > 2 ? options.Camera[2] : 1.;
  // Up, and the front: where a patient looks to (+y of RAS), elsewhere where y is small; if y is
  // up, where z is large. Positive azimuth goes to the patient's left, and elsewhere to the right.
  const int vertical = options.Up.back() - 'x';
  const double sign = options.Up[0] == '-' ? -1. : 1.;
  double up[3] = { 0., 0., 0. };
  up[vertical] = sign;
  double front[3] = { 0., 0., 0. };
  if (vertical == 1)
  {
    front[2] = 1.;
  }
  else
  {
    front[1] = this->TheVolume->IsRAS ? 1. : -1.;
  }
  double side[3];
  vtkMath::Cross(up, front, side);
  double to[3];
  double viewUp[3];
  for (int a = 0; a < 3; ++a)
  {
    const double level = std::cos(azimuth) * front[a] + std::sin(azimuth) * side[a];
    to[a] = std::cos(elevation) * level + std::sin(elevation) * up[a];
    viewUp[a] = std::cos(elevation) * up[a] - std::sin(elevation) * level;
  }

  // As near as all corners of the volume are seen; data rarely fills them, so a little nearer.
  double center[3];
  this->Shown->GetCenter(center);
  double right[3];
  vtkMath::Cross(viewUp, to, right);
  constexpr double angle = 24.;
  const double high = std::tan(vtkMath::RadiansFromDegrees(angle / 2.));
  const double wide = high * options.Size[0] / options.Size[1];
  double distance = 0.;
  int dims[3];
  this->Shown->GetDimensions(dims);
  for (int corner = 0; corner < 8; ++corner)
  {
    const double index[3] = { corner & 1 ? dims[0] - .5 : -.5, corner & 2 ? dims[1] - .5 : -.5,
      corner & 4 ? dims[2] - .5 : -.5 };
    double p[3];
    this->Shown->TransformContinuousIndexToPhysicalPoint(index, p);
    vtkMath::Subtract(p, center, p);
    distance = std::max({ distance, std::abs(vtkMath::Dot(p, right)) / wide + vtkMath::Dot(p, to),
      std::abs(vtkMath::Dot(p, viewUp)) / high + vtkMath::Dot(p, to) });
  }
  distance /= 1.05 * zoom;
  vtkCamera* camera = this->Scene->GetActiveCamera();
  camera->SetViewAngle(angle);
  camera->SetFocalPoint(center);
  camera->SetPosition(
    center[0] + distance * to[0], center[1] + distance * to[1], center[2] + distance * to[2]);
  camera->SetViewUp(viewUp);
  this->Scene->ResetCameraClippingRange();
}

// A key light that stands in the scene, and a weak one at the camera; for the other kinds VTK's own
// headlight.
void Pictures::Parts::PlaceLights(const std::string& kind)
{
  const bool environment = kind == "environment";
  const bool shaded = environment || kind == "shaded" || kind == "shadows";
  this->Scene->RemoveAllLights();
  this->Scene->SetEnvironmentTexture(nullptr);
  this->Mapper->SetLightingProperty(shaded && kind != "shaded" ? this->Lighting.Get() : nullptr);
  this->Lighting->SetEnvironmentStrength(environment ? .7 : 0.);
  this->Lighting->SetShadowStrength(this->TheOptions->ShadowStrength);
  this->Prop->GetProperty()->SetAmbient(environment ? 0. : .25);
  if (!shaded)
  {
    return;
  }
  const auto& angles = this->TheOptions->KeyLight;
  const double azimuth = vtkMath::RadiansFromDegrees(angles[0]);
  const double elevation = vtkMath::RadiansFromDegrees(angles[1]);
  vtkCamera* camera = this->Scene->GetActiveCamera();
  double to[3];
  double up[3];
  double right[3];
  double key[3];
  camera->GetDirectionOfProjection(to);
  camera->OrthogonalizeViewUp();
  camera->GetViewUp(up);
  vtkMath::Cross(to, up, right);
  for (int a = 0; a < 3; ++a)
  {
    key[a] = std::cos(elevation) * (-std::cos(azimuth) * to[a] + std::sin(azimuth) * right[a]) +
      std::sin(elevation) * up[a];
  }
  vtkNew<vtkLight> sun;
  sun->SetLightTypeToSceneLight();
  sun->SetFocalPoint(0., 0., 0.);
  sun->SetPosition(key);
  sun->SetIntensity(environment ? .8 : 1.15);
  sun->SetColor(1., .97, .92);
  this->Scene->AddLight(sun);
  vtkNew<vtkLight> fill;
  fill->SetLightTypeToHeadlight();
  fill->SetIntensity(environment ? .15 : .4);
  fill->SetColor(.88, .94, 1.);
  this->Scene->AddLight(fill);
  if (environment)
  {
    this->Scene->SetEnvironmentTexture(MakeSky(up, key));
  }
}

void Pictures::SetLight(vtkImageData* light, const std::array<double, 3>& slicePosition)
{
  Parts& p = *this->P;
  p.Light = vtkSmartPointer<vtkImageData>::New();
  p.Light->ShallowCopy(light);
  Shift(p.Light, p.Recentre);
  p.SlicePosition = slicePosition;
}

void Pictures::SetCaption(const std::vector<std::string>& lines)
{
  std::string& text = this->P->CaptionText;
  text.clear();
  for (const std::string& line : lines)
  {
    text += (text.empty() ? "" : "\n") + line;
  }
}

// False where there is no light of that sign.
bool Pictures::Parts::StyleBar(
  vtkScalarBarActor* bar, vtkLookupTable* colors, double sign, double extreme)
{
  double window[2];
  if (!(sign * extreme > 0.))
  {
    return false;
  }
  double range[2] = { 0., 0. };
  this->Light->GetPointData()->GetArray(vtkLightTransportArrays::Fluence)->GetRange(range);
  const double maximum = std::max(std::abs(range[0]), std::abs(range[1]));
  if (!this->Property->GetEffectiveWindow(maximum, window))
  {
    return false;
  }
  const bool logarithmic = this->Property->GetScale() == vtkLightFieldProperty::Logarithmic;
  constexpr int n = 256;
  colors->SetNumberOfTableValues(n);
  colors->SetScale(logarithmic ? VTK_SCALE_LOG10 : VTK_SCALE_LINEAR);
  colors->SetTableRange(window[0], window[1]);
  for (int i = 0; i < n; ++i)
  {
    const double t = (i + .5) / n;
    const double value = logarithmic ? window[0] * std::pow(window[1] / window[0], t)
                                     : window[0] + t * (window[1] - window[0]);
    double rgba[4];
    this->Property->MapValue(sign * value, maximum, rgba);
    colors->SetTableValue(i, rgba[0], rgba[1], rgba[2], 1.);
  }
  bar->SetLookupTable(colors);
  bar->SetNumberOfLabels(logarithmic ? static_cast<int>(this->Property->GetDecades() + 1.5) : 5);
  bar->SetLabelFormat("%.0e");
  bar->UnconstrainedFontSizeOn();
  const int size = std::clamp(this->TheOptions->Size[1] / 48, 8, 36);
  for (vtkTextProperty* text : { bar->GetLabelTextProperty(), bar->GetTitleTextProperty() })
  {
    text->SetFontFamilyToArial();
    text->SetFontSize(size);
    text->SetColor(.85, .85, .85);
    text->ItalicOff();
    text->BoldOff();
    text->ShadowOff();
  }
  bar->SetTitle(sign > 0. ? "fluence" : "negative");
  bar->SetBarRatio(.22);
  bar->SetVerticalTitleSeparation(size / 2);
  return true;
}

void Pictures::Parts::ShowLegend(bool on)
{
  this->Bar->SetVisibility(0);
  this->NegativeBar->SetVisibility(0);
  if (!on || !this->Light || this->Property->GetMode() == vtkLightFieldProperty::FluxDirection)
  {
    return;
  }
  vtkDataArray* fluence = this->Light->GetPointData()->GetArray(vtkLightTransportArrays::Fluence);
  double range[2] = { 0., 0. };
  fluence->GetRange(range);
  const double width = std::min(.14, 100. / this->TheOptions->Size[0]);
  double bottom = .5;
  for (int negative = 0; negative < 2; ++negative)
  {
    vtkScalarBarActor* bar = negative ? this->NegativeBar : this->Bar;
    // The solver's undershoot, below the last decade shown, is no negative light.
    const double lowest = range[1] * std::pow(10., 1. - this->Property->GetDecades());
    const double extreme = negative ? (-range[0] > lowest ? range[0] : 0.) : range[1];
    if (this->StyleBar(
          bar, negative ? this->NegativeColors : this->BarColors, negative ? -1. : 1., extreme))
    {
      bar->SetVisibility(1);
      bar->GetPositionCoordinate()->SetCoordinateSystemToNormalizedViewport();
      bar->SetPosition(.985 - width, bottom);
      bar->SetWidth(width);
      bar->SetHeight(.4);
      bottom -= .44;
    }
  }
}

void Pictures::Write(const std::string& kind, const std::string& path)
{
  Parts& p = *this->P;
  const bool slices = kind == "slices" || kind == "arrows";
  const bool lit = kind == "lit" || kind == "flux" || slices;
  p.Errors.Clear();
  p.Property->SetMode(kind == "flux"                  ? vtkLightFieldProperty::FluxDirection
      : p.TheOptions->View == "illuminate" && !slices ? vtkLightFieldProperty::Illuminate
                                                      : vtkLightFieldProperty::Overlay);
  if (slices)
  {
    p.Window->RemoveRenderer(p.Scene);
    p.Window->RemoveRenderer(p.Corner);
    p.Slices->SetInputData(p.Shown);
    p.Slices->SetLightFieldProperty(p.Property);
    p.Slices->SetLightFieldData(p.Light);
    p.Slices->SetPatientAxes(
      p.TheVolume->IsRAS ? vtkLightFieldSlices::RAS : vtkLightFieldSlices::Unknown);
    p.Slices->SetPosition(p.SlicePosition[0] + p.Recentre[0], p.SlicePosition[1] + p.Recentre[1],
      p.SlicePosition[2] + p.Recentre[2]);
    p.Slices->SetLengthUnits(p.TheVolume->Unit == "unit" ? "" : p.TheVolume->Unit);
    p.Slices->SetShowArrows(kind == "arrows");
    p.Slices->SetNumberOfArrowsAlong(44); // structures are small in the whole
    p.Slices->AddToRenderWindow(p.Window);
  }
  else
  {
    p.Mapper->SetLightFieldData(lit ? p.Light.Get() : nullptr);
    p.PlaceLights(kind);
    p.ShowLegend(lit);
    const char* axes = p.TheVolume->IsRAS
      ? "colour: where light flows to or from; red right-left, green front-back, blue up-down"
      : "colour: where light flows to or from; red along x, green y, blue z";
    p.Caption->SetInput((kind == "flux" ? axes + ("\n" + p.CaptionText) : p.CaptionText).c_str());
    p.Caption->SetVisibility(lit);
  }
  p.Window->Render();
  vtkNew<vtkWindowToImageFilter> grab;
  grab->SetInput(p.Window);
  grab->ReadFrontBufferOff();
  grab->ShouldRerenderOff();
  vtkNew<vtkPNGWriter> writer;
  p.Errors.Watch(writer);
  writer->SetInputConnection(grab->GetOutputPort());
  writer->SetFileName(path.c_str());
  writer->Write();
  if (slices)
  {
    p.Slices->RemoveFromRenderWindow();
    p.Window->AddRenderer(p.Scene);
    p.Window->AddRenderer(p.Corner);
  }
  if (p.Errors.Any())
  {
    throw Error("cannot make the picture '" + kind + "'" + p.Errors.Because());
  }
}

} // namespace lightvolume
