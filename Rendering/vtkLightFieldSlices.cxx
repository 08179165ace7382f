// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkLightFieldSlices.h"

#include "LightFieldLegend.h"
#include "LightFieldSliceFrame.h"
#include "LightFieldSliceImage.h"
#include "LightFieldSliceLayout.h"

#include "vtkActor.h"
#include "vtkActor2D.h"
#include "vtkAlgorithmOutput.h"
#include "vtkCallbackCommand.h"
#include "vtkCamera.h"
#include "vtkCellArray.h"
#include "vtkDataArray.h"
#include "vtkDataObject.h"
#include "vtkExecutive.h"
#include "vtkFloatArray.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkLightFieldProperty.h"
#include "vtkLightTransportArrays.h"
#include "vtkMath.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkPointData.h"
#include "vtkPoints.h"
#include "vtkPolyData.h"
#include "vtkPolyDataMapper.h"
#include "vtkPolyDataMapper2D.h"
#include "vtkProperty.h"
#include "vtkProperty2D.h"
#include "vtkRenderWindow.h"
#include "vtkRenderer.h"
#include "vtkSmartPointer.h"
#include "vtkStreamingDemandDrivenPipeline.h"
#include "vtkTextActor.h"
#include "vtkTextProperty.h"
#include "vtkTexture.h"
#include "vtkWeakPointer.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

using lighttransport::Box;
using lighttransport::Dot;
using lighttransport::SliceFrame;
using lighttransport::Vector3;

vtkStandardNewMacro(vtkLightFieldSlices);

namespace
{
constexpr int Slices = vtkLightFieldSlices::NumberOfSlices;
constexpr double LeastArrowPixels = 10.;

/** The extremes of a field and where they are; finite values only. */
struct FieldExtremes
{
  double largestMagnitude = 0.;
  vtkIdType strongest = -1; // of the largest positive value, else of the largest magnitude
  double largest = 0.;      // of the positive values
  double smallest = 0.;     // of the negative ones
};

FieldExtremes FindExtremes(vtkDataArray* array, int components)
{
  FieldExtremes extremes;
  double& largest = extremes.largest;
  double& smallest = extremes.smallest;
  vtkIdType mostNegative = -1;
  const vtkIdType count = array->GetNumberOfTuples();
  for (vtkIdType id = 0; id < count; ++id)
  {
    double value = array->GetComponent(id, 0);
    if (components == 3)
    {
      const double vector[3] = { value, array->GetComponent(id, 1), array->GetComponent(id, 2) };
      value = vtkMath::Norm(vector);
    }
    if (!std::isfinite(value))
    {
      continue;
    }
    if (value > largest)
    {
      largest = value;
      extremes.strongest = id;
    }
    else if (value < smallest)
    {
      smallest = value;
      mostNegative = id;
    }
  }
  extremes.largestMagnitude = std::max(largest, -smallest);
  if (extremes.strongest < 0)
  {
    extremes.strongest = mostNegative;
  }
  return extremes;
}

std::string Format(const char* format, double value)
{
  char text[64];
  std::snprintf(text, sizeof(text), format, value);
  return text;
}

void SetUpText(vtkTextActor* text, int fontSize)
{
  vtkTextProperty* look = text->GetTextProperty();
  look->SetFontSize(fontSize);
  look->SetColor(1., 1., 1.);
  // Legible over bone and over the light.
  look->SetBackgroundColor(0., 0., 0.);
  look->SetBackgroundOpacity(0.6);
}

/** What is upstream of a port. One that failed, and said why, runs again when it has changed. */
struct Pipeline
{
  vtkWeakPointer<vtkAlgorithm> producer;
  vtkMTimeType time = 0;
  bool failed = false;

  void Update(vtkAlgorithm* newProducer, int output)
  {
    auto* executive = vtkStreamingDemandDrivenPipeline::SafeDownCast(newProducer->GetExecutive());
    if (!executive)
    {
      newProducer->Update(output);
      this->failed = false;
      return;
    }
    const bool same = this->producer == newProducer && this->failed;
    this->producer = newProducer;
    executive->UpdateDataObject();
    executive->UpdatePipelineMTime();
    if (same && executive->GetPipelineMTime() == this->time)
    {
      return;
    }
    this->time = executive->GetPipelineMTime();
    this->failed = !executive->UpdateInformation();
    if (this->failed)
    {
      return;
    }
    // The whole extent: another consumer may have asked for a part.
    vtkInformation* info = executive->GetOutputInformation(output);
    if (info && info->Has(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT()))
    {
      info->Set(vtkStreamingDemandDrivenPipeline::UPDATE_EXTENT(),
        info->Get(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT()), 6);
    }
    this->failed = !executive->Update(output);
  }
};

/** A prop of lines and faces in one colour, unlit. */
struct FlatActor
{
  vtkNew<vtkPolyDataMapper> mapper;
  vtkNew<vtkActor> actor;

  void SetUp(vtkPolyData* data, double grey, double lineWidth)
  {
    this->mapper->SetInputData(data);
    this->mapper->ScalarVisibilityOff();
    this->actor->SetMapper(this->mapper);
    vtkProperty* look = this->actor->GetProperty();
    look->LightingOff();
    look->SetColor(grey, grey, grey);
    look->SetLineWidth(lineWidth);
  }
};
} // namespace

//------------------------------------------------------------------------------
class vtkLightFieldSlices::vtkInternals
{
public:
  /** Everything of one slice. */
  struct Panel
  {
    SliceFrame frame;
    vtkNew<vtkRenderer> renderer;
    vtkNew<vtkImageData> picture;
    vtkNew<vtkPolyData> quad;
    vtkNew<vtkPolyDataMapper> mapper;
    vtkNew<vtkTexture> texture;
    vtkNew<vtkActor> actor;
    vtkNew<vtkPolyData> cross;
    FlatActor crosshair;
    vtkNew<vtkPolyData> arrows;
    FlatActor arrowHalo;
    FlatActor arrowFill;
    vtkNew<vtkTextActor> marks[4]; // left, right, bottom, top
    vtkNew<vtkTextActor> caption;
    Box box;
    double middle[2] = { 0.5, 0.5 }; // (s, t) in the middle of the box
  };

  vtkInternals()
  {
    for (Panel& panel : this->Panels)
    {
      panel.mapper->SetInputData(panel.quad);
      panel.mapper->ScalarVisibilityOff();
      panel.texture->SetInputData(panel.picture);
      panel.texture->InterpolateOn();
      panel.texture->MipmapOn();
      panel.texture->RepeatOff(); // else the opposite edge shines through
      panel.texture->EdgeClampOn();
      panel.texture->SetColorModeToDirectScalars();
      panel.actor->SetMapper(panel.mapper);
      panel.actor->SetTexture(panel.texture);
      panel.actor->GetProperty()->LightingOff();
      panel.crosshair.SetUp(panel.cross, 0.65, 1.);
      panel.arrowHalo.SetUp(panel.arrows, 0., 3.5);
      panel.arrowHalo.actor->GetProperty()->EdgeVisibilityOff();
      panel.arrowFill.SetUp(panel.arrows, 1., 1.5);
      panel.renderer->AddActor(panel.actor);
      panel.renderer->AddActor(panel.crosshair.actor);
      panel.renderer->AddActor(panel.arrowHalo.actor);
      panel.renderer->AddActor(panel.arrowFill.actor);
      for (auto& mark : panel.marks)
      {
        panel.renderer->AddViewProp(mark);
      }
      panel.renderer->AddViewProp(panel.caption);
      panel.renderer->SetBackground(0., 0., 0.);
      panel.renderer->InteractiveOff();
      panel.renderer->GetActiveCamera()->ParallelProjectionOn();
    }
    // Clears what is between the others, and all of it where there is nothing to show.
    this->Background->SetBackground(0.25, 0.25, 0.25);
    this->Background->InteractiveOff();
    this->BarMapper->SetInputData(this->Bars);
    this->BarActor->SetMapper(this->BarMapper);
    this->LegendRenderer->AddViewProp(this->BarActor);
    this->LegendRenderer->SetBackground(0., 0., 0.);
    this->LegendRenderer->InteractiveOff();
  }

  /** In the order of drawing. */
  template <typename Function>
  void ForEachRenderer(const Function& function)
  {
    function(this->Background);
    for (Panel& panel : this->Panels)
    {
      function(panel.renderer);
    }
    function(this->LegendRenderer);
  }

  bool Build(vtkLightFieldSlices* self, vtkImageData* anatomy, vtkImageData* light);
  void BuildScene(vtkLightFieldSlices* self, Panel& panel);
  void MakeArrows(double cell);

  /** Whether the field's extreme shows: a solver's undershoot is far below the window. */
  bool IsVisible(double extreme) const
  {
    const double t = this->Property->GetPosition(extreme, this->Look.window);
    return this->Look.At(t, extreme < 0.)[3] > 0.02;
  }
  void Arrange(vtkLightFieldSlices* self, vtkRenderWindow* window);
  void ArrangePanel(vtkLightFieldSlices* self, Panel& panel, const Box& box, int fontSize);
  void ArrangeLegend(vtkLightFieldSlices* self, const Box& box, int fontSize);

  std::string CheckAnatomy(vtkLightFieldSlices* self, vtkImageData* anatomy, vtkDataArray*& array);
  std::string CheckField(
    vtkImageData* light, const char* name, int components, const char* hint, vtkDataArray*& array);

  Panel Panels[Slices];
  vtkNew<vtkRenderer> Background;
  vtkNew<vtkRenderer> LegendRenderer;
  vtkNew<vtkPolyData> Bars;
  vtkNew<vtkPolyDataMapper2D> BarMapper;
  vtkNew<vtkActor2D> BarActor;
  std::vector<vtkSmartPointer<vtkTextActor>> LegendTexts;

  vtkSmartPointer<vtkLightFieldProperty> Property = vtkSmartPointer<vtkLightFieldProperty>::New();
  vtkWeakPointer<vtkRenderWindow> Window;
  double Rectangle[4] = { 0., 0., 1., 1. };
  unsigned long Observer = 0;

  /** What the slices were made from; when one of these changes they are made anew. */
  struct BuildKey
  {
    vtkMTimeType self = 0;
    vtkImageData* anatomy = nullptr;
    vtkMTimeType anatomyTime = 0;
    vtkImageData* light = nullptr;
    vtkMTimeType lightTime = 0;
    bool failed[2] = { false, false };
    bool operator==(const BuildKey& o) const
    {
      return this->self == o.self && this->anatomy == o.anatomy &&
        this->anatomyTime == o.anatomyTime && this->light == o.light &&
        this->lightTime == o.lightTime && this->failed[0] == o.failed[0] &&
        this->failed[1] == o.failed[1];
    }
  };
  BuildKey Built;
  Pipeline Upstream[2];
  /** Extremes cost a pass over the field: kept while the field is the same. */
  FieldExtremes FluenceExtremes;
  FieldExtremes FluxExtremes;
  vtkDataArray* FluenceKnown = nullptr;
  vtkDataArray* FluxKnown = nullptr;
  vtkMTimeType FluenceTime = 0;
  vtkMTimeType FluxTime = 0;
  double AnatomyRange[2] = { 0., 1. };
  vtkDataArray* AnatomyKnown = nullptr;
  vtkMTimeType AnatomyTime = 0;
  int AnatomyComponent = -1;

  bool Valid = false;
  lighttransport::LightLook Look;
  FieldExtremes ShownExtremes; // of the field that the colours show
  lighttransport::ArrowLook Arrows;
  double LongestSide = 1.; // of any slice, in the world
  double Scale = 0.;       // pixels per world length
  int ArrangedSize[2] = { 0, 0 };
  bool NeedsArranging = true;
};

namespace
{
const FieldExtremes& Remember(vtkDataArray* array, int components, FieldExtremes& extremes,
  vtkDataArray*& known, vtkMTimeType& time)
{
  if (known != array || time != array->GetMTime())
  {
    extremes = FindExtremes(array, components);
    known = array;
    time = array->GetMTime();
  }
  return extremes;
}

/** "" or that an enumerator is none. */
std::string CheckChoice(const char* name, int value, int last)
{
  return value >= 0 && value <= last
    ? std::string()
    : name + (" is " + std::to_string(value)) + "; expected: 0 to " + std::to_string(last) + ". ";
}

/** "" or what is wrong with an image as such. */
std::string CheckImage(vtkImageData* image, const std::string& what)
{
  if (!image || image->GetNumberOfPoints() < 1)
  {
    return what + " is empty; expected: a vtkImageData with at least one point";
  }
  const double* spacing = image->GetSpacing();
  for (int axis = 0; axis < 3; ++axis)
  {
    if (!(spacing[axis] > 0.) || !std::isfinite(spacing[axis]))
    {
      return what + " has spacing " + Format("%g", spacing[axis]) + " along axis " +
        std::to_string(axis) + "; expected: a positive finite length";
    }
  }
  const double* origin = image->GetOrigin();
  if (!std::isfinite(origin[0]) || !std::isfinite(origin[1]) || !std::isfinite(origin[2]))
  {
    return what + " has an origin that is not finite; expected: three finite numbers";
  }
  return {};
}
} // namespace

//------------------------------------------------------------------------------
std::string vtkLightFieldSlices::vtkInternals::CheckAnatomy(
  vtkLightFieldSlices* self, vtkImageData* anatomy, vtkDataArray*& array)
{
  const std::string what = "The anatomy (input port 0)";
  std::string problem = CheckImage(anatomy, what);
  if (!problem.empty())
  {
    return problem;
  }
  array = self->GetInputArrayToProcess(0, anatomy);
  if (!array || array->GetNumberOfTuples() != anatomy->GetNumberOfPoints())
  {
    return what + " has no point scalars to show; expected: active point scalars, or an array " +
      "chosen with SetInputArrayToProcess(0, ...)";
  }
  if (self->Component < 0 || self->Component >= array->GetNumberOfComponents())
  {
    return "Component is " + std::to_string(self->Component) + "; expected: 0 to " +
      std::to_string(array->GetNumberOfComponents() - 1) + ", the components of " + what;
  }
  return {};
}

//------------------------------------------------------------------------------
std::string vtkLightFieldSlices::vtkInternals::CheckField(
  vtkImageData* light, const char* name, int components, const char* hint, vtkDataArray*& array)
{
  const std::string what = "The light field (input port 1)";
  std::string problem = CheckImage(light, what);
  if (!problem.empty())
  {
    return problem;
  }
  array = light->GetPointData()->GetArray(name);
  if (!array || array->GetNumberOfTuples() != light->GetNumberOfPoints() ||
    array->GetNumberOfComponents() != components)
  {
    const std::string has =
      array ? "of " + std::to_string(array->GetNumberOfComponents()) + " component(s)" : "missing";
    array = nullptr;
    return what + ": its point array " + name + " is " + has +
      "; expected: " + std::to_string(components) + " component(s) per point" + hint;
  }
  return {};
}

//------------------------------------------------------------------------------
bool vtkLightFieldSlices::vtkInternals::Build(
  vtkLightFieldSlices* self, vtkImageData* anatomy, vtkImageData* light)
{
  if (this->Upstream[0].failed)
  {
    return false; // upstream has said why
  }
  lighttransport::AnatomyLook anatomyLook;
  std::string problem = CheckChoice("PatientAxes", self->PatientAxes, LPS);
  problem += CheckChoice("Convention", self->Convention, Neurological);
  problem += CheckChoice("ArrowLength", self->ArrowLength, UniformLength);
  problem += CheckChoice("Layout", self->Layout, Grid);
  if (problem.empty())
  {
    problem = this->CheckAnatomy(self, anatomy, anatomyLook.array);
  }
  if (!problem.empty())
  {
    vtkErrorWithObjectMacro(self, << problem << ".");
    return false;
  }

  // The light: what is shown, and its extremes. A bad light leaves the anatomy.
  this->Look = lighttransport::LightLook();
  this->Look.property = this->Property;
  this->ShownExtremes = FieldExtremes();
  const bool showsFlux = this->Property->GetMode() == vtkLightFieldProperty::FluxDirection;
  vtkDataArray* fluence = nullptr;
  vtkDataArray* flux = nullptr;
  if (self->GetNumberOfInputConnections(1) > 0 && !this->Upstream[1].failed)
  {
    if (!showsFlux)
    {
      problem = this->CheckField(light, vtkLightTransportArrays::Fluence, 1, "", fluence);
    }
    if (problem.empty() && (showsFlux || self->ShowArrows))
    {
      problem = this->CheckField(
        light, vtkLightTransportArrays::Flux, 3, " (vtkLightDiffusionFilter::ComputeFluxOn)", flux);
    }
    if (!problem.empty())
    {
      vtkErrorWithObjectMacro(self, << problem << ".");
    }
    if (flux)
    {
      Remember(flux, 3, this->FluxExtremes, this->FluxKnown, this->FluxTime);
    }
    if (fluence)
    {
      Remember(fluence, 1, this->FluenceExtremes, this->FluenceKnown, this->FluenceTime);
    }
    vtkDataArray* shown = showsFlux ? flux : fluence;
    if (shown)
    {
      this->ShownExtremes = showsFlux ? this->FluxExtremes : this->FluenceExtremes;
      this->Look.field = lighttransport::FieldSampler(light, shown);
    }
  }
  this->Look.Tabulate(this->ShownExtremes.largestMagnitude);
  this->Look.hasWindow = this->Look.hasWindow && this->Look.field;

  // Stage 2: the position.
  double voxel[3];
  double wanted[3];
  std::copy_n(self->WantedPosition, 3, wanted);
  if (!self->HasPosition)
  {
    if (this->ShownExtremes.strongest >= 0)
    {
      light->GetPoint(this->ShownExtremes.strongest, wanted);
    }
    else
    {
      const int* extent = anatomy->GetExtent();
      const double middle[3] = { 0.5 * (extent[0] + extent[1]), 0.5 * (extent[2] + extent[3]),
        0.5 * (extent[4] + extent[5]) };
      const Vector3 world = lighttransport::IndexToWorld(anatomy, middle);
      std::copy(world.begin(), world.end(), wanted);
    }
  }
  lighttransport::NearestVoxel(anatomy, wanted, voxel);
  const Vector3 used = lighttransport::IndexToWorld(anatomy, voxel);
  std::copy(used.begin(), used.end(), self->UsedPosition);

  // The grey values.
  anatomyLook.isColor = anatomyLook.array->GetDataType() == VTK_UNSIGNED_CHAR &&
    (anatomyLook.array->GetNumberOfComponents() == 3 ||
      anatomyLook.array->GetNumberOfComponents() == 4);
  anatomyLook.component = self->Component;
  if (!self->HasWindowLevel)
  {
    if (this->AnatomyKnown != anatomyLook.array ||
      this->AnatomyTime != anatomyLook.array->GetMTime() ||
      this->AnatomyComponent != self->Component)
    {
      lighttransport::RobustRange(
        anatomyLook.array, self->Component, 0.005, 0.995, this->AnatomyRange);
      this->AnatomyKnown = anatomyLook.array;
      this->AnatomyTime = anatomyLook.array->GetMTime();
      this->AnatomyComponent = self->Component;
    }
    self->ColorWindow = this->AnatomyRange[1] - this->AnatomyRange[0];
    self->ColorLevel = 0.5 * (this->AnatomyRange[0] + this->AnatomyRange[1]);
  }
  anatomyLook.black = self->ColorLevel - 0.5 * self->ColorWindow;
  anatomyLook.white = self->ColorLevel + 0.5 * self->ColorWindow;

  // Stages 1 and 3: axes and colours.
  lighttransport::SliceConvention convention;
  convention.orientationKnown = self->PatientAxes != Unknown;
  convention.worldIsLPS = self->PatientAxes == LPS;
  convention.neurological = self->Convention == Neurological;
  double longest = 0.;
  for (int slice = 0; slice < Slices; ++slice)
  {
    Panel& panel = this->Panels[slice];
    panel.frame = lighttransport::OrientSlice(anatomy, slice, convention);
    lighttransport::PlaceSlice(panel.frame, anatomy, voxel);
    longest = std::max({ longest, panel.frame.length[0], panel.frame.length[1] });
  }
  for (Panel& panel : this->Panels)
  {
    lighttransport::FillSlice(panel.picture, panel.frame, anatomy, anatomyLook,
      this->Look.field ? light : nullptr, this->Look);
    this->BuildScene(self, panel);
  }
  this->Arrows = lighttransport::ArrowLook();
  if (self->ShowArrows && flux)
  {
    this->Arrows.flux = lighttransport::FieldSampler(light, flux);
    this->Arrows.largest = this->FluxExtremes.largestMagnitude;
    this->Arrows.decades = this->Property->GetDecades();
    this->Arrows.uniform = self->ArrowLength == UniformLength;
  }
  this->LongestSide = longest;
  this->MakeArrows(longest / self->NumberOfArrowsAlong / self->Zoom);
  return true;
}

//------------------------------------------------------------------------------
void vtkLightFieldSlices::vtkInternals::MakeArrows(double cell)
{
  this->Arrows.cell = cell;
  for (Panel& panel : this->Panels)
  {
    lighttransport::FillArrows(panel.arrows, panel.frame, this->Arrows);
  }
}

//------------------------------------------------------------------------------
void vtkLightFieldSlices::vtkInternals::BuildScene(vtkLightFieldSlices* self, Panel& panel)
{
  const SliceFrame& frame = panel.frame;
  const double diagonal = std::hypot(frame.length[0], frame.length[1]);

  // The picture on its rectangle.
  vtkNew<vtkPoints> corners;
  corners->SetDataTypeToDouble();
  vtkNew<vtkFloatArray> coordinates;
  coordinates->SetNumberOfComponents(2);
  const double st[4][2] = { { 0., 0. }, { 1., 0. }, { 1., 1. }, { 0., 1. } };
  for (const auto& corner : st)
  {
    corners->InsertNextPoint(frame.At(corner[0], corner[1]).data());
    coordinates->InsertNextTuple2(corner[0], corner[1]);
  }
  vtkNew<vtkCellArray> face;
  const vtkIdType ids[4] = { 0, 1, 2, 3 };
  face->InsertNextCell(4, ids);
  panel.quad->Initialize();
  panel.quad->SetPoints(corners);
  panel.quad->SetPolys(face);
  panel.quad->GetPointData()->SetTCoords(coordinates);

  // The crosshair: two lines with a gap around the point.
  Vector3 toPoint;
  for (int c = 0; c < 3; ++c)
  {
    toPoint[c] = self->UsedPosition[c] - frame.origin[c];
  }
  const double s = Dot(toPoint, frame.right) / frame.length[0];
  const double t = Dot(toPoint, frame.up) / frame.length[1];
  const double gap = 0.04 * std::max(frame.length[0], frame.length[1]);
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  vtkNew<vtkCellArray> lines;
  const double gapS = gap / frame.length[0];
  const double gapT = gap / frame.length[1];
  const double ends[4][4] = { { 0., t, s - gapS, t }, { s + gapS, t, 1., t },
    { s, 0., s, t - gapT }, { s, t + gapT, s, 1. } };
  for (const auto& end : ends)
  {
    if (end[2] > end[0] || end[3] > end[1])
    {
      const vtkIdType line[2] = { points->InsertNextPoint(frame.At(end[0], end[1]).data()),
        points->InsertNextPoint(frame.At(end[2], end[3]).data()) };
      lines->InsertNextCell(2, line);
    }
  }
  panel.cross->Initialize();
  panel.cross->SetPoints(points);
  panel.cross->SetLines(lines);

  // One above the other, towards the viewer.
  vtkActor* layers[3] = { panel.crosshair.actor, panel.arrowHalo.actor, panel.arrowFill.actor };
  for (int layer = 0; layer < 3; ++layer)
  {
    const double height = 0.002 * (layer + 1) * diagonal;
    layers[layer]->SetPosition(
      height * frame.toViewer[0], height * frame.toViewer[1], height * frame.toViewer[2]);
  }
  panel.crosshair.actor->SetVisibility(self->ShowCrosshair);

  // Zoomed in, the point is in the middle; else the slice.
  panel.middle[0] = self->Zoom > 1. ? s : 0.5;
  panel.middle[1] = self->Zoom > 1. ? t : 0.5;
  const Vector3 center = frame.At(panel.middle[0], panel.middle[1]);
  vtkCamera* camera = panel.renderer->GetActiveCamera();
  camera->SetFocalPoint(center[0], center[1], center[2]);
  camera->SetPosition(center[0] + diagonal * frame.toViewer[0],
    center[1] + diagonal * frame.toViewer[1], center[2] + diagonal * frame.toViewer[2]);
  camera->SetViewUp(frame.up[0], frame.up[1], frame.up[2]);
  camera->SetClippingRange(0.5 * diagonal, 1.5 * diagonal);
}

//------------------------------------------------------------------------------
void vtkLightFieldSlices::vtkInternals::Arrange(vtkLightFieldSlices* self, vtkRenderWindow* window)
{
  const int* size = window->GetActualSize();
  const int left = static_cast<int>(std::lround(this->Rectangle[0] * size[0]));
  const int bottom = static_cast<int>(std::lround(this->Rectangle[1] * size[1]));
  lighttransport::LayoutNeeds needs;
  needs.width = std::max(1, static_cast<int>(std::lround(this->Rectangle[2] * size[0])) - left);
  needs.height = std::max(1, static_cast<int>(std::lround(this->Rectangle[3] * size[1])) - bottom);
  const int fontSize = std::min(18,
    std::max(9, static_cast<int>(std::lround(std::sqrt(1. * needs.width * needs.height) / 30.))));
  needs.least = std::min(3 * fontSize, std::max(1, needs.width / 6));
  const bool legend = self->ShowLegend && this->Look.hasWindow &&
    (this->IsVisible(this->ShownExtremes.largest) || this->IsVisible(this->ShownExtremes.smallest));
  const bool isFlux = this->Look.mode == vtkLightFieldProperty::FluxDirection;
  needs.legend =
    legend ? std::min(lighttransport::LegendWidth(fontSize, isFlux), needs.width / 3) : 0;
  for (int slice = 0; slice < Slices; ++slice)
  {
    std::copy_n(this->Panels[slice].frame.length, 2, needs.length[slice]);
  }
  const lighttransport::LayoutPlan row = lighttransport::PlanRow(needs);
  const lighttransport::LayoutPlan grid = lighttransport::PlanGrid(needs);
  const lighttransport::LayoutPlan& plan =
    self->Layout == Row || (self->Layout != Grid && row.scale >= grid.scale) ? row : grid;
  this->Scale = plan.scale * self->Zoom;
  if (this->Arrows.flux)
  {
    const double wanted = this->LongestSide / self->NumberOfArrowsAlong / self->Zoom;
    const double cell = std::max(wanted, LeastArrowPixels / this->Scale);
    if (cell != this->Arrows.cell)
    {
      this->MakeArrows(cell);
    }
  }

  const auto place = [&](vtkRenderer* renderer, const Box& box)
  {
    renderer->SetViewport(static_cast<double>(left + box.x) / size[0],
      static_cast<double>(bottom + box.y) / size[1],
      static_cast<double>(left + box.x + box.width) / size[0],
      static_cast<double>(bottom + box.y + box.height) / size[1]);
  };
  for (int slice = 0; slice < Slices; ++slice)
  {
    Panel& panel = this->Panels[slice];
    panel.box = plan.boxes[slice];
    panel.box.x += left;
    panel.box.y += bottom;
    place(panel.renderer, plan.boxes[slice]);
    this->ArrangePanel(self, panel, panel.box, fontSize);
  }
  const Box& legendBox = plan.boxes[Slices];
  const bool hasRoom = legendBox.width > 0 && legendBox.height > 0;
  this->LegendRenderer->SetDraw(hasRoom);
  if (hasRoom)
  {
    place(this->LegendRenderer, legendBox);
    this->ArrangeLegend(self, legend ? legendBox : Box(), fontSize);
  }
}

//------------------------------------------------------------------------------
void vtkLightFieldSlices::vtkInternals::ArrangePanel(
  vtkLightFieldSlices* self, Panel& panel, const Box& box, int fontSize)
{
  const SliceFrame& frame = panel.frame;
  panel.renderer->GetActiveCamera()->SetParallelScale(0.5 * box.height / this->Scale);

  const bool marks = self->ShowMarks && !frame.marks.empty();
  const double inset = 3.;
  const double middleX = 0.5 * box.width;
  const double middleY = 0.5 * box.height;
  const double places[4][2] = { { inset, middleY }, { box.width - inset, middleY },
    { middleX, inset }, { middleX, box.height - inset } };
  for (int n = 0; n < 4; ++n)
  {
    vtkTextActor* mark = panel.marks[n];
    SetUpText(mark, fontSize);
    vtkTextProperty* look = mark->GetTextProperty();
    look->BoldOn();
    look->SetJustification(n == 0 ? VTK_TEXT_LEFT : n == 1 ? VTK_TEXT_RIGHT : VTK_TEXT_CENTERED);
    look->SetVerticalJustification(n == 2 ? VTK_TEXT_BOTTOM
        : n == 3                          ? VTK_TEXT_TOP
                                          : VTK_TEXT_CENTERED);
    mark->SetInput(marks ? std::string(1, frame.marks[n]).c_str() : "");
    mark->SetPosition(places[n][0], places[n][1]);
    mark->SetVisibility(marks);
  }

  // Where the slice is: a distance to the side named by a letter, or an index.
  std::string text;
  if (frame.normalMarks.empty())
  {
    text = std::string(1, "ijk"[frame.normalAxis]) + " " + std::to_string(frame.index);
  }
  else
  {
    // Along the patient's axis, so in the way that its letter says.
    const char upper = frame.normalMarks[1];
    const int axis = upper == 'L' || upper == 'R' ? 0 : upper == 'P' || upper == 'A' ? 1 : 2;
    const bool worldIsLPS = self->PatientAxes == LPS;
    const double toRAS = worldIsLPS && axis < 2 ? -1. : 1.;
    const double value = toRAS * self->UsedPosition[axis];
    const char letters[3][2] = { { 'L', 'R' }, { 'P', 'A' }, { 'I', 'S' } };
    text =
      std::string(1, letters[axis][value >= 0. ? 1 : 0]) + " " + Format("%.1f", std::abs(value));
    const std::string longer = text + " " + self->LengthUnits;
    if (!self->LengthUnits.empty() && 0.55 * fontSize * longer.size() < middleX - fontSize)
    {
      text = longer;
    }
  }
  const bool fits = 0.55 * fontSize * text.size() < (marks ? middleX - 0.6 * fontSize : box.width);
  SetUpText(panel.caption, fontSize);
  panel.caption->SetInput(text.c_str());
  panel.caption->SetPosition(inset, inset);
  panel.caption->GetTextProperty()->SetVerticalJustificationToBottom();
  panel.caption->SetVisibility(self->ShowCaptions && fits);
}

//------------------------------------------------------------------------------
void vtkLightFieldSlices::vtkInternals::ArrangeLegend(
  vtkLightFieldSlices* self, const Box& box, int fontSize)
{
  for (vtkTextActor* text : this->LegendTexts)
  {
    this->LegendRenderer->RemoveViewProp(text);
  }
  this->LegendTexts.clear();
  this->Bars->Initialize();
  if (box.width < 1)
  {
    return;
  }
  const bool isFlux = this->Look.mode == vtkLightFieldProperty::FluxDirection;
  const bool isLPS = self->PatientAxes == LPS;
  std::string names[3] = { "x", "y", "z" };
  if (self->PatientAxes != Unknown)
  {
    names[0] = isLPS ? "L" : "R";
    names[1] = isLPS ? "P" : "A";
    names[2] = "S";
  }
  const std::string title = (isFlux ? "flux (" : "fluence (") + self->FluenceUnits + ")";
  const lighttransport::Legend legend =
    lighttransport::MakeLegend(this->Bars, this->Look, this->IsVisible(this->ShownExtremes.largest),
      this->IsVisible(this->ShownExtremes.smallest), title, names, box.width, box.height, fontSize);
  for (const lighttransport::LegendLabel& label : legend.labels)
  {
    vtkNew<vtkTextActor> text;
    SetUpText(text, fontSize);
    vtkTextProperty* look = text->GetTextProperty();
    text->SetInput(label.text.c_str());
    if (label.isTitle)
    {
      look->SetOrientation(90.);
      look->SetJustificationToCentered();
      look->SetVerticalJustificationToTop();
    }
    else
    {
      look->SetVerticalJustificationToCentered();
    }
    text->SetPosition(label.x, label.y);
    this->LegendRenderer->AddViewProp(text);
    this->LegendTexts.emplace_back(text);
  }
}

//------------------------------------------------------------------------------
vtkLightFieldSlices::vtkLightFieldSlices()
  : Internals(new vtkInternals)
{
  this->SetNumberOfInputPorts(2);
  this->SetNumberOfOutputPorts(0);
  this->SetInputArrayToProcess(
    0, 0, 0, vtkDataObject::FIELD_ASSOCIATION_POINTS, vtkDataSetAttributes::SCALARS);
}

//------------------------------------------------------------------------------
vtkLightFieldSlices::~vtkLightFieldSlices()
{
  this->RemoveFromRenderWindow();
}

//------------------------------------------------------------------------------
int vtkLightFieldSlices::FillInputPortInformation(int port, vtkInformation* info)
{
  info->Set(vtkAlgorithm::INPUT_REQUIRED_DATA_TYPE(), "vtkImageData");
  info->Set(vtkAlgorithm::INPUT_IS_OPTIONAL(), port);
  return 1;
}

//------------------------------------------------------------------------------
void vtkLightFieldSlices::SetInputData(vtkImageData* anatomy)
{
  this->SetInputDataInternal(0, anatomy);
}

//------------------------------------------------------------------------------
void vtkLightFieldSlices::SetLightFieldConnection(vtkAlgorithmOutput* light)
{
  this->SetInputConnection(1, light);
}

//------------------------------------------------------------------------------
void vtkLightFieldSlices::SetLightFieldData(vtkImageData* light)
{
  this->SetInputDataInternal(1, light);
}

//------------------------------------------------------------------------------
void vtkLightFieldSlices::SetLightFieldProperty(vtkLightFieldProperty* property)
{
  if (property != this->Internals->Property)
  {
    this->Internals->Property =
      property ? property : vtkSmartPointer<vtkLightFieldProperty>::New().Get();
    this->Modified();
  }
}

//------------------------------------------------------------------------------
vtkLightFieldProperty* vtkLightFieldSlices::GetLightFieldProperty()
{
  return this->Internals->Property;
}

//------------------------------------------------------------------------------
vtkMTimeType vtkLightFieldSlices::GetMTime()
{
  return std::max(this->Superclass::GetMTime(), this->Internals->Property->GetMTime());
}

//------------------------------------------------------------------------------
void vtkLightFieldSlices::AddToRenderWindow(
  vtkRenderWindow* window, double x0, double y0, double x1, double y1)
{
  this->RemoveFromRenderWindow();
  if (!window)
  {
    return;
  }
  if (!(x0 >= 0. && y0 >= 0. && x1 <= 1. && y1 <= 1. && x0 < x1 && y0 < y1))
  {
    vtkErrorMacro("The rectangle in the window is (" << x0 << ", " << y0 << ", " << x1 << ", " << y1
                                                     << "); expected: 0 <= x0 < x1 <= 1, also y.");
    return;
  }
  const double rectangle[4] = { x0, y0, x1, y1 };
  std::copy_n(rectangle, 4, this->Internals->Rectangle);
  this->Internals->Window = window;
  this->Internals->ForEachRenderer([&](vtkRenderer* renderer) { window->AddRenderer(renderer); });
  this->Internals->Background->SetViewport(x0, y0, x1, y1);
  this->Internals->NeedsArranging = true;

  vtkNew<vtkCallbackCommand> onRender;
  onRender->SetClientData(this);
  onRender->SetCallback([](vtkObject*, unsigned long, void* self, void*)
    { static_cast<vtkLightFieldSlices*>(self)->Update(); });
  this->Internals->Observer = window->AddObserver(vtkCommand::StartEvent, onRender);
}

//------------------------------------------------------------------------------
void vtkLightFieldSlices::RemoveFromRenderWindow()
{
  if (vtkRenderWindow* window = this->Internals->Window)
  {
    window->RemoveObserver(this->Internals->Observer);
    this->Internals->ForEachRenderer(
      [&](vtkRenderer* renderer) { window->RemoveRenderer(renderer); });
  }
  this->Internals->Window = nullptr;
}

//------------------------------------------------------------------------------
vtkRenderWindow* vtkLightFieldSlices::GetRenderWindow()
{
  return this->Internals->Window;
}

//------------------------------------------------------------------------------
void vtkLightFieldSlices::SetPosition(double x, double y, double z)
{
  if (!std::isfinite(x) || !std::isfinite(y) || !std::isfinite(z))
  {
    vtkErrorMacro("Position is (" << x << ", " << y << ", " << z << "); expected: finite numbers.");
    return;
  }
  const double position[3] = { x, y, z };
  if (!this->HasPosition || !std::equal(position, position + 3, this->WantedPosition))
  {
    std::copy_n(position, 3, this->WantedPosition);
    this->HasPosition = true;
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkLightFieldSlices::ClearPosition()
{
  if (this->HasPosition)
  {
    this->HasPosition = false;
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkLightFieldSlices::SetZoom(double zoom)
{
  if (!(zoom >= 1.) || !std::isfinite(zoom))
  {
    vtkErrorMacro("Zoom is " << zoom << "; expected: a finite number of at least 1.");
    return;
  }
  if (this->Zoom != zoom)
  {
    this->Zoom = zoom;
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkLightFieldSlices::SetWindowLevel(double window, double level)
{
  if (!std::isfinite(window) || !std::isfinite(level))
  {
    vtkErrorMacro("Window is " << window << ", level " << level << "; expected: finite numbers.");
    return;
  }
  if (!this->HasWindowLevel || this->ColorWindow != window || this->ColorLevel != level)
  {
    this->ColorWindow = window;
    this->ColorLevel = level;
    this->HasWindowLevel = true;
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkLightFieldSlices::ClearWindowLevel()
{
  if (this->HasWindowLevel)
  {
    this->HasWindowLevel = false;
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkLightFieldSlices::Update()
{
  vtkInternals& internals = *this->Internals;
  vtkImageData* images[2] = { nullptr, nullptr };
  for (int port = 0; port < 2; ++port)
  {
    if (this->GetNumberOfInputConnections(port) > 0)
    {
      int output = 0;
      vtkAlgorithm* producer = this->GetInputAlgorithm(port, 0, output);
      internals.Upstream[port].Update(producer, output);
      images[port] = vtkImageData::SafeDownCast(this->GetInputDataObject(port, 0));
    }
    else
    {
      internals.Upstream[port] = Pipeline();
    }
  }
  vtkInternals::BuildKey key;
  key.self = this->GetMTime();
  key.anatomy = images[0];
  key.anatomyTime = images[0] ? images[0]->GetMTime() : 0;
  key.light = images[1];
  key.lightTime = images[1] ? images[1]->GetMTime() : 0;
  key.failed[0] = internals.Upstream[0].failed;
  key.failed[1] = internals.Upstream[1].failed;
  if (!(key == internals.Built))
  {
    internals.Valid = internals.Build(this, images[0], images[1]);
    internals.Built = key;
    internals.NeedsArranging = true;
    ++this->NumberOfBuilds;
    internals.ForEachRenderer([&](vtkRenderer* renderer)
      { renderer->SetDraw(internals.Valid || renderer == internals.Background); });
  }
  vtkRenderWindow* window = internals.Window;
  if (!window || !internals.Valid)
  {
    return;
  }
  // Stage 4: the layout.
  const int* size = window->GetActualSize();
  if (internals.NeedsArranging || !std::equal(size, size + 2, internals.ArrangedSize))
  {
    internals.Arrange(this, window);
    std::copy_n(size, 2, internals.ArrangedSize);
    internals.NeedsArranging = false;
  }
}

//------------------------------------------------------------------------------
vtkRenderer* vtkLightFieldSlices::GetSliceRenderer(int slice)
{
  return slice >= 0 && slice < Slices ? this->Internals->Panels[slice].renderer.Get() : nullptr;
}

//------------------------------------------------------------------------------
vtkRenderer* vtkLightFieldSlices::GetLegendRenderer()
{
  return this->Internals->LegendRenderer;
}

//------------------------------------------------------------------------------
vtkImageData* vtkLightFieldSlices::GetSliceImage(int slice)
{
  return slice >= 0 && slice < Slices ? this->Internals->Panels[slice].picture.Get() : nullptr;
}

//------------------------------------------------------------------------------
vtkPolyData* vtkLightFieldSlices::GetArrows(int slice)
{
  return slice >= 0 && slice < Slices ? this->Internals->Panels[slice].arrows.Get() : nullptr;
}

//------------------------------------------------------------------------------
std::string vtkLightFieldSlices::GetMarks(int slice)
{
  return slice >= 0 && slice < Slices ? this->Internals->Panels[slice].frame.marks : std::string();
}

//------------------------------------------------------------------------------
bool vtkLightFieldSlices::DisplayToWorld(double x, double y, double world[3])
{
  if (!this->Internals->Valid || !(this->Internals->Scale > 0.))
  {
    return false;
  }
  for (const auto& panel : this->Internals->Panels)
  {
    const SliceFrame& frame = panel.frame;
    // From the middle of the box.
    const double dx = x + 0.5 - panel.box.x - 0.5 * panel.box.width;
    const double dy = y + 0.5 - panel.box.y - 0.5 * panel.box.height;
    const double s = panel.middle[0] + dx / (this->Internals->Scale * frame.length[0]);
    const double t = panel.middle[1] + dy / (this->Internals->Scale * frame.length[1]);
    if (std::abs(dx) <= 0.5 * panel.box.width && std::abs(dy) <= 0.5 * panel.box.height &&
      s >= 0. && s <= 1. && t >= 0. && t <= 1.)
    {
      const Vector3 point = frame.At(s, t);
      std::copy(point.begin(), point.end(), world);
      return true;
    }
  }
  return false;
}

//------------------------------------------------------------------------------
void vtkLightFieldSlices::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "Position: " << this->UsedPosition[0] << " " << this->UsedPosition[1] << " "
     << this->UsedPosition[2] << (this->HasPosition ? "" : " (automatic)") << "\n";
  os << indent << "PatientAxes: " << this->PatientAxes << "\n";
  os << indent << "Convention: " << this->Convention << "\n";
  os << indent << "ColorWindow: " << this->ColorWindow << "\n";
  os << indent << "ColorLevel: " << this->ColorLevel << "\n";
  os << indent << "Component: " << this->Component << "\n";
  os << indent << "ShowArrows: " << this->ShowArrows << "\n";
  os << indent << "ArrowLength: " << this->ArrowLength << "\n";
  os << indent << "NumberOfArrowsAlong: " << this->NumberOfArrowsAlong << "\n";
  os << indent << "ShowCrosshair: " << this->ShowCrosshair << "\n";
  os << indent << "ShowMarks: " << this->ShowMarks << "\n";
  os << indent << "ShowCaptions: " << this->ShowCaptions << "\n";
  os << indent << "ShowLegend: " << this->ShowLegend << "\n";
  os << indent << "FluenceUnits: " << this->FluenceUnits << "\n";
  os << indent << "LengthUnits: " << this->LengthUnits << "\n";
  os << indent << "Zoom: " << this->Zoom << "\n";
  os << indent << "Layout: " << this->Layout << "\n";
  os << indent << "NumberOfBuilds: " << this->NumberOfBuilds << "\n";
}
