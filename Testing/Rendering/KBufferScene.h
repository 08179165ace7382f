// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Windows with translucent surfaces of known colours, and what the tests of
 * vtkBucketedKBufferPass share: a parallel camera that looks along -z at
 * [0,1]^2, unlit rectangles, pictures with alpha, "over" on the CPU.
 */
#ifndef KBufferScene_h
#define KBufferScene_h

#include "LightTransportRenderingTesting.h"

#include "LightTransportFilterTesting.h"

#include "vtkActor.h"
#include "vtkBucketedKBufferPass.h"
#include "vtkCamera.h"
#include "vtkCellArray.h"
#include "vtkDualDepthPeelingPass.h"
#include "vtkOpenGLRenderWindow.h"
#include "vtkOpenGLRenderer.h"
#include "vtkPoints.h"
#include "vtkPolyData.h"
#include "vtkPolyDataMapper.h"
#include "vtkProperty.h"
#include "vtkRenderStepsPass.h"
#include "vtkRenderWindow.h"
#include "vtkRenderer.h"
#include "vtkTranslucentPass.h"

#include <algorithm>
#include <array>
#include <random>
#include <vector>

namespace lighttransport
{
namespace testing
{
using Rgba = std::array<double, 4>;

/** A rectangle of one colour at z; the camera is at z = 10, so larger z is nearer. */
struct Layer
{
  double z = 0.;
  Rgba color = { 1., 1., 1., .5 };
  std::array<double, 4> box = { -99., 100., -99., 100. };
  double tilt = 0.; // z at x is z + tilt x
};

inline vtkSmartPointer<vtkActor> makeLayer(const Layer& layer)
{
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  const auto& b = layer.box;
  for (const auto& p :
    { std::array<double, 2>{ b[0], b[2] }, { b[1], b[2] }, { b[1], b[3] }, { b[0], b[3] } })
  {
    points->InsertNextPoint(p[0], p[1], layer.z + layer.tilt * p[0]);
  }
  vtkNew<vtkCellArray> cells;
  const vtkIdType quad[4] = { 0, 1, 2, 3 };
  cells->InsertNextCell(4, quad);
  vtkNew<vtkPolyData> data;
  data->SetPoints(points);
  data->SetPolys(cells);
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputData(data);
  auto actor = vtkSmartPointer<vtkActor>::New();
  actor->SetMapper(mapper);
  actor->GetProperty()->LightingOff();
  actor->GetProperty()->SetColor(layer.color[0], layer.color[1], layer.color[2]);
  actor->GetProperty()->SetOpacity(layer.color[3]);
  return actor;
}

/** Distinct depths, in no order; repeatable. */
inline std::vector<Layer> randomLayers(
  int count, unsigned seed, double lowest = .03, double highest = .5)
{
  std::mt19937 random(seed);
  const auto uniform = [&](double lo, double hi)
  { return lo + (hi - lo) * (random() / 4294967296.); };
  std::vector<Layer> layers(count);
  for (int i = 0; i < count; ++i)
  {
    layers[i].z = -4. + 8. * i / count;
    layers[i].color = { uniform(0., 1.), uniform(0., 1.), uniform(0., 1.),
      uniform(lowest, highest) };
  }
  std::shuffle(layers.begin(), layers.end(), random);
  return layers;
}

/** Premultiplied: the layers at x, the nearest over the next, over the background. */
inline Rgba over(std::vector<Layer> layers, double x, const Rgba& background)
{
  const auto z = [x](const Layer& l) { return l.z + l.tilt * x; };
  std::sort(
    layers.begin(), layers.end(), [&](const Layer& a, const Layer& b) { return z(a) < z(b); });
  Rgba result = background;
  for (const Layer& layer : layers)
  {
    const double alpha = layer.color[3];
    for (int c = 0; c < 4; ++c)
    {
      result[c] = alpha * (c < 3 ? layer.color[c] : 1.) + (1. - alpha) * result[c];
    }
  }
  return result;
}

/** What 8 bits make of a colour. */
inline double toByte(double c)
{
  return std::floor(255. * c + .5) / 255.;
}

/** RGBA, 8 bits, rows upwards. */
inline std::vector<unsigned char> captureRgba(vtkRenderWindow* window)
{
  window->Render();
  const int* size = window->GetActualSize();
  vtkNew<vtkUnsignedCharArray> pixels;
  window->GetRGBACharPixelData(0, 0, size[0] - 1, size[1] - 1, 0, pixels);
  const unsigned char* first = pixels->GetPointer(0);
  return std::vector<unsigned char>(first, first + pixels->GetNumberOfValues());
}

/** Largest difference of a channel; 255 where the sizes differ. */
inline int largestDifference(
  const std::vector<unsigned char>& a, const std::vector<unsigned char>& b)
{
  int largest = a.size() == b.size() ? 0 : 255;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
  {
    largest = std::max(largest, std::abs(int(a[i]) - int(b[i])));
  }
  return largest;
}

/** What KHR_debug has told of errors so far, in all windows of KBufferScene. */
inline int& openGLDebugErrors()
{
  static int count = 0;
  return count;
}

inline void GLAPIENTRY countDebugErrors(
  GLenum, GLenum type, GLuint, GLenum, GLsizei, const GLchar* message, const void*)
{
  if (type == GL_DEBUG_TYPE_ERROR)
  {
    ++openGLDebugErrors();
    std::cout << "OpenGL: " << message << "\n";
  }
}

/** A window and a renderer with the pass under test. */
struct KBufferScene
{
  vtkNew<vtkRenderWindow> window;
  vtkNew<vtkRenderer> renderer;
  vtkNew<vtkBucketedKBufferPass> pass;
  vtkNew<MessageLog> log;
  bool watched = false;

  explicit KBufferScene(int width = 40, int height = 30)
  {
    this->window->SetMultiSamples(0);
    this->window->SetAlphaBitPlanes(1);
    this->window->SetSize(width, height);
    this->window->AddRenderer(this->renderer);
    this->pass->SetNumberOfLayers(32);
    this->renderer->SetPass(this->pass);
    this->renderer->SetBackground(.2, .4, .1);
    lookAtUnitSquare(this->renderer);
    this->pass->AddObserver(vtkCommand::ErrorEvent, this->log);
    this->pass->AddObserver(vtkCommand::WarningEvent, this->log);
  }

  static void lookAtUnitSquare(vtkRenderer* renderer)
  {
    vtkCamera* camera = renderer->GetActiveCamera();
    camera->ParallelProjectionOn();
    camera->SetFocalPoint(.5, .5, 0.);
    camera->SetPosition(.5, .5, 10.);
    camera->SetViewUp(0., 1., 0.);
    camera->SetParallelScale(.5);
    camera->SetClippingRange(1., 20.);
  }

  void add(const std::vector<Layer>& layers)
  {
    for (const Layer& layer : layers)
    {
      this->renderer->AddActor(makeLayer(layer));
    }
  }

  std::vector<unsigned char> capture()
  {
    if (!this->watched)
    {
      this->watched = true;
      vtkOpenGLRenderWindow::SafeDownCast(this->window)->Initialize();
      if (glDebugMessageCallback)
      {
        glEnable(GL_DEBUG_OUTPUT);
        glEnable(GL_DEBUG_OUTPUT_SYNCHRONOUS);
        glDebugMessageCallback(countDebugErrors, nullptr);
      }
    }
    return captureRgba(this->window);
  }

  /** VTK's exact pass in place of ours. */
  void peel()
  {
    vtkNew<vtkTranslucentPass> translucent;
    vtkNew<vtkDualDepthPeelingPass> peeling;
    peeling->SetTranslucentPass(translucent);
    peeling->SetMaximumNumberOfPeels(100);
    peeling->SetOcclusionRatio(0.);
    vtkNew<vtkRenderStepsPass> steps;
    steps->SetTranslucentPass(peeling);
    this->renderer->SetPass(steps);
  }

  /** World x of the middle of a column of pixels. */
  double x(int column)
  {
    const int* size = this->window->GetActualSize();
    return .5 + ((column + .5) / size[0] - .5) * size[0] / size[1];
  }

  /** Largest difference from "over" the background, as 8 bits hold it, of all pixels, in 1/255. */
  double differenceFromOver(
    const std::vector<unsigned char>& pixels, const std::vector<Layer>& layers, bool alpha)
  {
    const int* size = this->window->GetActualSize();
    const double* b = this->renderer->GetBackground();
    const double backAlpha = this->renderer->GetBackgroundAlpha();
    double largest = 0.;
    for (int column = 0; column < size[0]; ++column)
    {
      const Rgba expected = over(
        layers, this->x(column), { toByte(b[0]), toByte(b[1]), toByte(b[2]), toByte(backAlpha) });
      for (int row = 0; row < size[1]; ++row)
      {
        for (int c = 0; c < (alpha ? 4 : 3); ++c)
        {
          const double value = pixels[4 * (std::size_t(row) * size[0] + column) + c];
          largest = std::max(largest, std::abs(value - 255. * expected[c]));
        }
      }
    }
    return largest;
  }
};
} // namespace testing
} // namespace lighttransport

#endif
