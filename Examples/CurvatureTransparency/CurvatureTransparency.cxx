// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Opacity that follows curvature: CurvatureTransparency [picture.png [mesh.ply...]]
 *
 * Without meshes, a rounded box around a ring.
 */
#include "vtkBucketedKBufferPass.h"
#include "vtkCurvatureOpacityProperty.h"
#include "vtkLightTransportEGLRenderWindow.h"

#include "vtkActor.h"
#include "vtkCamera.h"
#include "vtkNew.h"
#include "vtkPLYReader.h"
#include "vtkPNGWriter.h"
#include "vtkPolyDataAlgorithm.h"
#include "vtkPolyDataMapper.h"
#include "vtkPolyDataNormals.h"
#include "vtkProperty.h"
#include "vtkRenderWindow.h"
#include "vtkRenderer.h"
#include "vtkSmartPointer.h"
#include "vtkSuperquadricSource.h"
#include "vtkWindowToImageFilter.h"

#include <iostream>
#include <vector>

namespace
{
vtkSmartPointer<vtkPolyDataAlgorithm> shape(bool ring)
{
  auto source = vtkSmartPointer<vtkSuperquadricSource>::New();
  source->SetToroidal(ring);
  source->SetSize(ring ? .45 : .5);
  source->SetPhiRoundness(ring ? 1. : .2);
  source->SetThetaRoundness(ring ? 1. : .2);
  source->SetThetaResolution(128);
  source->SetPhiResolution(128);
  return source;
}
} // namespace

int main(int argc, char* argv[])
{
  vtkLightTransportEGLRenderWindow::UseIfHeadless(); // works without a screen, too

  std::vector<vtkSmartPointer<vtkPolyDataAlgorithm>> sources;
  for (int i = 2; i < argc; ++i)
  {
    vtkNew<vtkPLYReader> reader;
    reader->SetFileName(argv[i]);
    sources.emplace_back(reader);
  }
  if (sources.empty())
  {
    sources = { shape(false), shape(true) };
  }

  // What makes the difference: a pass, and its curvature opacity.
  vtkNew<vtkBucketedKBufferPass> surfaces;
  vtkCurvatureOpacityProperty* curvature = surfaces->GetCurvatureOpacityProperty();
  curvature->CurvatureShadingOn();
  curvature->CurvatureOpacityOn();
  vtkNew<vtkRenderer> renderer;
  renderer->SetPass(surfaces);
  renderer->SetBackground(1., 1., 1.);

  const double colors[2][3] = { { .4, .55, .85 }, { .9, .6, .2 } };
  for (std::size_t i = 0; i < sources.size(); ++i)
  {
    vtkNew<vtkPolyDataNormals> normals; // curvature is the turn of the normals
    normals->SetInputConnection(sources[i]->GetOutputPort());
    vtkNew<vtkPolyDataMapper> mapper;
    mapper->SetInputConnection(normals->GetOutputPort());
    vtkNew<vtkActor> actor;
    actor->SetMapper(mapper);
    actor->GetProperty()->SetColor(colors[i % 2][0], colors[i % 2][1], colors[i % 2][2]);
    actor->GetProperty()->SetOpacity(.4); // less than 1: takes part
    renderer->AddActor(actor);
  }

  vtkNew<vtkRenderWindow> window;
  window->SetOffScreenRendering(1);
  window->SetMultiSamples(0);
  window->SetSize(300, 300);
  window->AddRenderer(renderer);
  renderer->GetActiveCamera()->SetPosition(1., .7, 2.);
  renderer->ResetCamera();
  window->Render();

  if (argc > 1)
  {
    vtkNew<vtkWindowToImageFilter> grab;
    grab->SetInput(window);
    vtkNew<vtkPNGWriter> writer;
    writer->SetInputConnection(grab->GetOutputPort());
    writer->SetFileName(argv[1]);
    writer->Write();
  }
  std::cout << surfaces->GetNumberOfFragments() << " fragments\n";
  return surfaces->GetNumberOfFragments() > 0 ? 0 : 1;
}
