// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/** A window with one volume, its light, and what the volume mapper's tests share. */
#ifndef VolumeMapperScene_h
#define VolumeMapperScene_h

#include "LightTransportRenderingTesting.h"

#include "vtkCamera.h"
#include "vtkColorTransferFunction.h"
#include "vtkCommand.h"
#include "vtkDoubleArray.h"
#include "vtkFloatArray.h"
#include "vtkImageData.h"
#include "vtkLightFieldProperty.h"
#include "vtkLightTransportArrays.h"
#include "vtkLightTransportVolumeMapper.h"
#include "vtkNew.h"
#include "vtkOpenGLGPUVolumeRayCastMapper.h"
#include "vtkPiecewiseFunction.h"
#include "vtkPointData.h"
#include "vtkRenderWindow.h"
#include "vtkRenderer.h"
#include "vtkSmartPointer.h"
#include "vtkVolume.h"
#include "vtkVolumeProperty.h"

#include <cmath>
#include <functional>
#include <string>
#include <vector>

namespace lighttransport
{
namespace testing
{
/** Takes an object's errors and warnings, which then are not printed. */
class Observer : public vtkCommand
{
public:
  static Observer* New() { return new Observer; }

  explicit Observer(vtkObject* object = nullptr)
  {
    if (object)
    {
      this->observe(object);
    }
  }
  void observe(vtkObject* object)
  {
    object->AddObserver(vtkCommand::ErrorEvent, this);
    object->AddObserver(vtkCommand::WarningEvent, this);
  }
  void Execute(vtkObject*, unsigned long event, void* data) override
  {
    (event == vtkCommand::ErrorEvent ? this->errors : this->warnings)
      .push_back(static_cast<const char*>(data));
  }
  bool hasError(const std::string& part) const
  {
    return !this->errors.empty() && this->errors.back().find(part) != std::string::npos;
  }
  std::string all() const
  {
    std::string text;
    for (const auto& messages : { this->errors, this->warnings })
    {
      for (const std::string& message : messages)
      {
        text += message + "\n";
      }
    }
    return text;
  }

  std::vector<std::string> errors;
  std::vector<std::string> warnings;
};

inline vtkSmartPointer<Observer> observe(vtkObject* object)
{
  auto observer = vtkSmartPointer<Observer>::New();
  observer->observe(object);
  return observer;
}

/**
 * A window that stays: an X server without clients resets, and refuses the
 * window that the next sub-case opens meanwhile.
 */
struct KeepDisplay
{
  KeepDisplay()
  {
    this->window->SetSize(16, 16);
    this->window->Render();
  }
  vtkNew<vtkRenderWindow> window;
};

using Point = std::array<double, 3>;

/** n^3 points over [0, n-1]^3. */
inline vtkSmartPointer<vtkImageData> makeGrid(int nx, int ny, int nz)
{
  auto image = vtkSmartPointer<vtkImageData>::New();
  image->SetDimensions(nx, ny, nz);
  return image;
}

/** Sets active scalars from a function of the world point. */
template <typename Array = vtkFloatArray>
void setScalars(vtkImageData* image, const std::function<double(const Point&)>& f)
{
  vtkNew<Array> array;
  array->SetName("Grey");
  array->SetNumberOfTuples(image->GetNumberOfPoints());
  for (vtkIdType i = 0; i < image->GetNumberOfPoints(); ++i)
  {
    Point p;
    image->GetPoint(i, p.data());
    array->SetTuple1(i, f(p));
  }
  image->GetPointData()->SetScalars(array);
}

template <typename Array = vtkFloatArray>
void setFluence(vtkImageData* image, const std::function<double(const Point&)>& phi)
{
  vtkNew<Array> array;
  array->SetName(vtkLightTransportArrays::Fluence);
  array->SetNumberOfTuples(image->GetNumberOfPoints());
  for (vtkIdType i = 0; i < image->GetNumberOfPoints(); ++i)
  {
    Point p;
    image->GetPoint(i, p.data());
    array->SetTuple1(i, phi(p));
  }
  image->GetPointData()->AddArray(array);
}

inline void setFlux(vtkImageData* image, const std::function<Point(const Point&)>& flux)
{
  vtkNew<vtkFloatArray> array;
  array->SetName(vtkLightTransportArrays::Flux);
  array->SetNumberOfComponents(3);
  array->SetNumberOfTuples(image->GetNumberOfPoints());
  for (vtkIdType i = 0; i < image->GetNumberOfPoints(); ++i)
  {
    Point p;
    image->GetPoint(i, p.data());
    array->SetTuple(i, flux(p).data());
  }
  image->GetPointData()->AddArray(array);
}

/** Grey 0 outside a ball of radius r about c, in it 20..100 with a gradient. */
inline double ball(const Point& p, const Point& c, double r)
{
  const double d = std::hypot(p[0] - c[0], p[1] - c[1], p[2] - c[2]);
  return d > r ? 0. : 100. - 80. * d / r;
}

/** exp(-mu d) / (d + 0.5) about c. */
inline double glow(const Point& p, const Point& c, double mu)
{
  const double d = std::hypot(p[0] - c[0], p[1] - c[1], p[2] - c[2]);
  return std::exp(-mu * d) / (d + .5);
}

/** One volume in one window. */
template <typename Mapper>
struct Scene
{
  explicit Scene(vtkImageData* image, int width = 64, int height = 64)
  {
    this->mapper->SetInputData(image);
    this->mapper->AutoAdjustSampleDistancesOff();
    this->mapper->SetSampleDistance(.5F);
    this->color->AddRGBPoint(0., .1, .1, .1);
    this->color->AddRGBPoint(100., .9, .8, .7);
    this->opacity->AddPoint(0., 0.);
    this->opacity->AddPoint(10., 0.);
    this->opacity->AddPoint(100., .1);
    this->property->SetColor(this->color);
    this->property->SetScalarOpacity(this->opacity);
    this->property->SetInterpolationTypeToLinear();
    this->volume->SetMapper(this->mapper);
    this->volume->SetProperty(this->property);
    this->renderer->AddVolume(this->volume);
    this->renderer->SetBackground(0., 0., 0.);
    this->window->SetMultiSamples(0);
    this->window->SetSize(width, height);
    this->window->AddRenderer(this->renderer);
    this->look({ -1., -.6, .5 });
  }

  /** From a direction at all of the volume. */
  void look(const Point& from, bool parallel = false)
  {
    double b[6];
    this->volume->GetBounds(b);
    vtkCamera* camera = this->renderer->GetActiveCamera();
    const Point c = { (b[0] + b[1]) / 2., (b[2] + b[3]) / 2., (b[4] + b[5]) / 2. };
    camera->SetFocalPoint(c.data());
    camera->SetPosition(c[0] + from[0], c[1] + from[1], c[2] + from[2]);
    const bool alongZ = std::abs(from[2]) > std::abs(from[0]) + std::abs(from[1]);
    camera->SetViewUp(0., alongZ ? 1. : 0., alongZ ? 0. : 1.);
    camera->SetParallelProjection(parallel);
    this->renderer->ResetCamera(b);
  }

  Picture capture() { return testing::capture(this->window); }

  vtkNew<Mapper> mapper;
  vtkNew<vtkColorTransferFunction> color;
  vtkNew<vtkPiecewiseFunction> opacity;
  vtkNew<vtkVolumeProperty> property;
  vtkNew<vtkVolume> volume;
  vtkNew<vtkRenderer> renderer;
  vtkNew<vtkRenderWindow> window;
};

using StockScene = Scene<vtkOpenGLGPUVolumeRayCastMapper>;
using LitScene = Scene<vtkLightTransportVolumeMapper>;

/** A grey ramp over t whose opacity is 1 wherever there is light. */
inline void useGreyLight(vtkLightFieldProperty* light)
{
  vtkNew<vtkColorTransferFunction> grey;
  grey->AddRGBPoint(0., 0., 0., 0.);
  grey->AddRGBPoint(1., 1., 1., 1.);
  vtkNew<vtkPiecewiseFunction> solid;
  solid->AddPoint(0., 1.);
  solid->AddPoint(1., 1.);
  light->SetPositiveColorMap(grey);
  light->SetLightOpacityFunction(solid);
  light->SetLightOpacity(1.);
}
} // namespace testing
} // namespace lighttransport

#endif
