// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * VTK's physically based shading, image-based light, tone mapping and ambient occlusion
 * together with vtkBucketedKBufferPass: as with vtkDualDepthPeelingPass in its place.
 */
#include "KBufferScene.h"

#include "vtkImageData.h"
#include "vtkOpaquePass.h"
#include "vtkPBRLUTTexture.h"
#include "vtkPBRPrefilterTexture.h"
#include "vtkSSAOPass.h"
#include "vtkSphereSource.h"
#include "vtkTexture.h"
#include "vtkToneMappingPass.h"

using namespace lighttransport::testing;

namespace
{
vtkSmartPointer<vtkActor> sphereAt(double x, double radius)
{
  vtkNew<vtkSphereSource> sphere;
  sphere->SetCenter(x, .5, 0.);
  sphere->SetRadius(radius);
  sphere->SetThetaResolution(24);
  sphere->SetPhiResolution(24);
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputConnection(sphere->GetOutputPort());
  auto actor = vtkSmartPointer<vtkActor>::New();
  actor->SetMapper(mapper);
  actor->GetProperty()->SetOpacity(.4);
  return actor;
}

/** Image-based light, tone mapping and ambient occlusion of VTK's, with the pass. */
void testOtherPasses(Suite& suite)
{
  vtkNew<vtkImageData> sky;
  sky->SetDimensions(32, 16, 1);
  sky->AllocateScalars(VTK_FLOAT, 3);
  auto* light = static_cast<float*>(sky->GetScalarPointer());
  for (int i = 0; i < 32 * 16; ++i)
  {
    const int row = i / 32;
    const float up = static_cast<float>(row) / 15.F;
    light[3 * i] = .3F + 2.F * up;
    light[3 * i + 1] = .4F + 1.5F * up;
    light[3 * i + 2] = .8F + up;
  }
  vtkNew<vtkTexture> environment;
  environment->SetInputData(sky);
  environment->MipmapOn();
  environment->InterpolateOn();
  environment->SetColorModeToDirectScalars();

  enum Way
  {
    Alone,
    ToneMapped,
    Occluded
  };
  for (const Way way : { Alone, ToneMapped, Occluded })
  {
    std::vector<unsigned char> pictures[2];
    for (const bool ours : { true, false })
    {
      KBufferScene scene(90, 80);
      vtkCamera* camera = scene.renderer->GetActiveCamera();
      camera->ParallelProjectionOff();
      camera->SetPosition(1.2, 1.1, 2.5);
      auto shiny = sphereAt(.6, .4);
      shiny->GetProperty()->SetInterpolationToPBR();
      shiny->GetProperty()->SetMetallic(.5);
      shiny->GetProperty()->SetRoughness(.3);
      auto opaque = sphereAt(.3, .3);
      opaque->GetProperty()->SetOpacity(1.);
      scene.renderer->AddActor(opaque);
      scene.renderer->AddActor(shiny);
      scene.renderer->AddActor(sphereAt(.1, .3));
      scene.renderer->UseImageBasedLightingOn();
      auto* openGL = vtkOpenGLRenderer::SafeDownCast(scene.renderer);
      openGL->GetEnvMapPrefiltered()->SetPrefilterLevels(2);
      openGL->GetEnvMapPrefiltered()->SetPrefilterMaxSamples(16);
      openGL->GetEnvMapLookupTable()->SetLUTSize(32);
      openGL->GetEnvMapLookupTable()->SetLUTSamples(32);
      scene.renderer->SetEnvironmentTexture(environment);
      scene.renderer->ResetCameraClippingRange();

      // The two lines of the documentation, and depth peeling in the same place.
      vtkNew<vtkRenderStepsPass> steps;
      steps->SetTranslucentPass(scene.pass);
      vtkNew<vtkTranslucentPass> translucent;
      vtkNew<vtkDualDepthPeelingPass> peeling;
      peeling->SetTranslucentPass(translucent);
      peeling->SetMaximumNumberOfPeels(100);
      peeling->SetOcclusionRatio(0.);
      if (!ours)
      {
        steps->SetTranslucentPass(peeling);
      }
      vtkNew<vtkToneMappingPass> toneMapping;
      toneMapping->SetDelegatePass(steps);
      vtkNew<vtkSSAOPass> occlusion;
      vtkNew<vtkOpaquePass> opaquePass;
      occlusion->SetDelegatePass(opaquePass);
      occlusion->SetRadius(.2);
      if (way == Occluded)
      {
        steps->SetOpaquePass(occlusion);
      }
      scene.renderer->SetPass(
        way == ToneMapped ? static_cast<vtkRenderPass*>(toneMapping) : steps.Get());
      pictures[ours] = scene.capture();
      if (ours)
      {
        LT_CHECK(suite, scene.pass->GetNumberOfFragments() > 1000);
      }
      LT_CHECK(suite, scene.log->messages.empty() && openGLErrors().empty());
      if (ours && way == Alone)
      {
        // Image-based light without a sequence: the same.
        scene.renderer->SetPass(scene.pass);
        LT_CHECK(suite, largestDifference(pictures[1], scene.capture()) == 0);
      }
    }
    int differing = 0;
    int dark = 0;
    for (std::size_t i = 0; i < pictures[0].size(); ++i)
    {
      differing += i % 4 != 3 && std::abs(int(pictures[0][i]) - int(pictures[1][i])) > 4;
      dark += i % 4 == 0 && pictures[1][i] > 100;
    }
    suite.check(differing <= 40,
      "way " + std::to_string(way) + ": " + std::to_string(differing) + " channels differ",
      __FILE__, __LINE__);
    LT_CHECK(suite, dark > 200);
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
  testOtherPasses(suite);
  LT_CHECK(suite, openGLDebugErrors() == 0);
  return suite.result();
}
