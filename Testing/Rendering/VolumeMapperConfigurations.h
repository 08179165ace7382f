// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/** Every way in which the superclass draws a volume: what the mapper's tests go through. */
#ifndef VolumeMapperConfigurations_h
#define VolumeMapperConfigurations_h

#include "VolumeMapperScene.h"

#include "vtkContourValues.h"
#include "vtkLight.h"
#include "vtkPlane.h"
#include "vtkUnsignedCharArray.h"

namespace lighttransport
{
namespace testing
{
constexpr int N = 20;
const Point Middle = { 9.5, 9.5, 9.5 };

inline vtkSmartPointer<vtkImageData> oneComponent()
{
  auto image = makeGrid(N, N, N);
  setScalars(image, [](const Point& p) { return ball(p, Middle, 9.); });
  return image;
}

inline vtkSmartPointer<vtkImageData> components(int count)
{
  auto image = makeGrid(N, N, N);
  vtkNew<vtkUnsignedCharArray> array;
  array->SetName("Grey");
  array->SetNumberOfComponents(count);
  array->SetNumberOfTuples(image->GetNumberOfPoints());
  for (vtkIdType i = 0; i < image->GetNumberOfPoints(); ++i)
  {
    Point p;
    image->GetPoint(i, p.data());
    for (int c = 0; c < count; ++c)
    {
      array->SetComponent(i, c, ball(p, { 7.5 + c, 9.5, 9.5 }, 8.));
    }
  }
  image->GetPointData()->SetScalars(array);
  return image;
}

/** What is done to a mapper and its property, stock and ours alike. */
struct Configuration
{
  const char* name;
  int blend;
  int components;
  bool lightShows;
  std::function<void(vtkGPUVolumeRayCastMapper*, vtkVolumeProperty*, vtkRenderer*)> apply;
};

inline void nothing(vtkGPUVolumeRayCastMapper*, vtkVolumeProperty*, vtkRenderer*) {}

inline void shade(vtkGPUVolumeRayCastMapper*, vtkVolumeProperty* property, vtkRenderer*)
{
  property->ShadeOn();
}

inline void transfer2D(vtkVolumeProperty* property, int component = 0)
{
  vtkNew<vtkImageData> function;
  function->SetDimensions(32, 32, 1);
  function->AllocateScalars(VTK_FLOAT, 4);
  auto* rgba = static_cast<float*>(function->GetScalarPointer());
  for (int i = 0; i < 32 * 32; ++i)
  {
    const int row = i / 32;
    rgba[4 * i] = static_cast<float>(i % 32) / 31.F;
    rgba[4 * i + 1] = .5F;
    rgba[4 * i + 2] = static_cast<float>(row) / 31.F;
    rgba[4 * i + 3] = .1F * static_cast<float>(i % 32) / 31.F;
  }
  property->SetTransferFunction2D(component, function);
  property->SetTransferFunctionMode(vtkVolumeProperty::TF_2D);
  // 9.1 declares the gradients that it uses only with a gradient opacity.
  vtkNew<vtkPiecewiseFunction> gradient;
  gradient->AddPoint(0., 1.);
  gradient->AddPoint(100., .8);
  property->SetGradientOpacity(component, gradient);
}

inline void gradientOpacity(vtkVolumeProperty* property)
{
  vtkNew<vtkPiecewiseFunction> gradient;
  gradient->AddPoint(0., .2);
  gradient->AddPoint(10., 1.);
  property->SetGradientOpacity(0, gradient);
}

inline void otherComponents(vtkVolumeProperty* property, int count)
{
  for (int c = 1; c < count; ++c)
  {
    property->SetColor(c, property->GetRGBTransferFunction(0));
    property->SetScalarOpacity(c, property->GetScalarOpacity(0));
    property->SetComponentWeight(c, .5);
  }
}

/** The least of a ray is the outside's, which needs an opacity to be seen. */
inline void everywhere(vtkVolumeProperty* property)
{
  property->GetScalarOpacity()->RemoveAllPoints();
  property->GetScalarOpacity()->AddPoint(0., .5);
}

inline std::vector<Configuration> configurations()
{
  using M = vtkGPUVolumeRayCastMapper;
  using P = vtkVolumeProperty;
  using R = vtkRenderer;
  constexpr int composite = vtkVolumeMapper::COMPOSITE_BLEND;
  constexpr int maximum = vtkVolumeMapper::MAXIMUM_INTENSITY_BLEND;
  constexpr int minimum = vtkVolumeMapper::MINIMUM_INTENSITY_BLEND;
  constexpr int average = vtkVolumeMapper::AVERAGE_INTENSITY_BLEND;
  constexpr int additive = vtkVolumeMapper::ADDITIVE_BLEND;
  constexpr int isosurface = vtkVolumeMapper::ISOSURFACE_BLEND;
  constexpr int slice = vtkVolumeMapper::SLICE_BLEND;
  const auto contours = [](M*, P* p, R*)
  {
    p->ShadeOn();
    p->GetIsoSurfaceValues()->SetValue(0, 30.);
    p->GetIsoSurfaceValues()->SetValue(1, 70.);
    p->GetScalarOpacity()->AddPoint(30., .3);
    p->GetScalarOpacity()->AddPoint(70., .5);
  };
  const auto cut = [](M*, P* p, R*)
  {
    vtkNew<vtkPlane> plane;
    plane->SetOrigin(9.5, 9.5, 9.5);
    plane->SetNormal(1., .5, 0.);
    p->SetSliceFunction(plane);
    p->GetScalarOpacity()->AddPoint(100., .9);
  };
  const auto parallel = [](M*, P*, R* r)
  {
    r->GetActiveCamera()->ParallelProjectionOn();
    r->ResetCamera();
  };
  return {
    { "composite", composite, 1, true, nothing },
    { "composite shaded", composite, 1, true, shade },
    { "composite shaded by two lights", composite, 1, true,
      [](M*, P* p, R* r)
      {
        p->ShadeOn();
        for (const double x : { -50., 50. })
        {
          vtkNew<vtkLight> light;
          light->SetLightTypeToSceneLight();
          light->SetPosition(x, 0., 50.);
          r->AddLight(light);
        }
      } },
    { "composite shaded by a spot", composite, 1, true,
      [](M*, P* p, R* r)
      {
        p->ShadeOn();
        vtkNew<vtkLight> light;
        light->SetLightTypeToSceneLight();
        light->SetPosition(-50., 0., 50.);
        light->SetFocalPoint(9., 9., 9.);
        light->PositionalOn();
        light->SetConeAngle(40.);
        r->AddLight(light);
      } },
    { "composite nearest", composite, 1, true,
      [](M*, P* p, R*) { p->SetInterpolationTypeToNearest(); } },
    { "composite parallel", composite, 1, true, parallel },
    { "composite gradient opacity", composite, 1, true, [](M*, P* p, R*) { gradientOpacity(p); } },
    { "composite gradient opacity shaded", composite, 1, true,
      [](M*, P* p, R*)
      {
        gradientOpacity(p);
        p->ShadeOn();
      } },
    { "composite 2-D", composite, 1, true, [](M*, P* p, R*) { transfer2D(p); } },
    { "composite 2-D shaded", composite, 1, true,
      [](M*, P* p, R*)
      {
        transfer2D(p);
        p->ShadeOn();
      } },
    { "composite jittered", composite, 1, true, [](M* m, P*, R*) { m->UseJitteringOn(); } },
    { "composite clipped", composite, 1, true,
      [](M* m, P*, R*)
      {
        vtkNew<vtkPlane> plane;
        plane->SetOrigin(8., 9., 9.);
        plane->SetNormal(1., .3, .2);
        m->AddClippingPlane(plane);
      } },
    { "composite cropped", composite, 1, true,
      [](M* m, P*, R*)
      {
        m->CroppingOn();
        m->SetCroppingRegionPlanes(6., 14., 6., 14., 6., 14.);
        m->SetCroppingRegionFlagsToFence();
      } },
    { "composite binary mask", composite, 1, true,
      [](M* m, P*, R*)
      {
        auto mask = makeGrid(N, N, N);
        setScalars<vtkUnsignedCharArray>(
          mask, [](const Point& p) { return p[0] + p[1] < 22. ? 255. : 0.; });
        m->SetMaskInput(mask);
        m->SetMaskTypeToBinary();
      } },
    { "composite label mask", composite, 1, true,
      [](M* m, P* p, R*)
      {
        auto mask = makeGrid(N, N, N);
        setScalars<vtkUnsignedCharArray>(mask, [](const Point& q) { return q[0] < 9. ? 1. : 2.; });
        m->SetMaskInput(mask);
        m->SetMaskTypeToLabelMap();
        m->SetMaskBlendFactor(.6F);
        for (int label = 1; label <= 2; ++label)
        {
          vtkNew<vtkColorTransferFunction> color;
          color->AddRGBPoint(0., label - 1., .3, 2. - label);
          vtkNew<vtkPiecewiseFunction> opacity;
          opacity->AddPoint(0., 0.);
          opacity->AddPoint(100., .1);
          p->SetLabelColor(label, color);
          p->SetLabelScalarOpacity(label, opacity);
        }
      } },
    { "composite coarse image", composite, 1, true,
      [](M* m, P*, R*) { m->SetImageSampleDistance(2.F); } },
    { "composite two independent components", composite, 2, true,
      [](M*, P* p, R*) { otherComponents(p, 2); } },
    { "composite two independent components gradient opacity", composite, 2, true,
      [](M*, P* p, R*)
      {
        otherComponents(p, 2);
        gradientOpacity(p);
        vtkNew<vtkPiecewiseFunction> other;
        other->AddPoint(0., .9);
        other->AddPoint(12., .1);
        p->SetGradientOpacity(1, other);
      } },
    { "composite four independent components shaded", composite, 4, true,
      [](M*, P* p, R*)
      {
        otherComponents(p, 4);
        p->ShadeOn();
      } },
    { "composite two dependent components", composite, 2, true,
      [](M*, P* p, R*) { p->IndependentComponentsOff(); } },
    { "composite four dependent components", composite, 4, true,
      [](M*, P* p, R*) { p->IndependentComponentsOff(); } },
    { "composite partitions", composite, 1, true,
      [](M* m, P*, R*)
      { vtkOpenGLGPUVolumeRayCastMapper::SafeDownCast(m)->SetPartitions(2, 1, 2); } },
    { "maximum", maximum, 1, true, nothing },
    { "maximum shaded", maximum, 1, true, shade },
    { "maximum 2-D", maximum, 1, true, [](M*, P* p, R*) { transfer2D(p); } },
    { "maximum independent components", maximum, 3, true,
      [](M*, P* p, R*) { otherComponents(p, 3); } },
    { "maximum dependent components", maximum, 4, true,
      [](M*, P* p, R*)
      {
        p->GetScalarOpacity()->AddPoint(100., .9);
        p->IndependentComponentsOff();
      } },
    { "maximum parallel", maximum, 1, true, parallel },
    { "minimum", minimum, 1, true, [](M*, P* p, R*) { everywhere(p); } },
    { "minimum independent components", minimum, 2, true,
      [](M*, P* p, R*)
      {
        everywhere(p);
        otherComponents(p, 2);
      } },
    { "average", average, 1, false, nothing },
    { "average components", average, 2, false, [](M*, P* p, R*) { otherComponents(p, 2); } },
    { "additive", additive, 1, false, nothing },
    { "isosurface", isosurface, 1, true, contours },
    { "slice", slice, 1, true, cut },
    { "slice shaded", slice, 1, true,
      [cut](M* m, P* p, R* r)
      {
        cut(m, p, r);
        p->ShadeOn();
      } },
  };
}
} // namespace testing
} // namespace lighttransport

#endif
