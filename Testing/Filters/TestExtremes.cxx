// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Medium, seeds and diffusion at the extremes of their parameters. At each: an
 * answer that is finite, balanced and of the right sign, or a reason that says
 * otherwise. Module/Documentation/extremes.md is the table of what is seen here.
 */
#include "LightTransportFilterTesting.h"

#include "vtkDoubleArray.h"
#include "vtkFloatArray.h"
#include "vtkLightDiffusionFilter.h"
#include "vtkLightSeedFilter.h"
#include "vtkOpticalMediumFilter.h"
#include "vtkPiecewiseFunction.h"

#include <cmath>
#include <functional>
#include <limits>
#include <random>

using lighttransport::testing::makeImage;
using lighttransport::testing::MessageLog;
using lighttransport::testing::pointArray;
using lighttransport::testing::Suite;
using Filter = vtkLightDiffusionFilter;

namespace
{
/** A ball of 100 in 0, and two lamps. */
struct Pipeline
{
  vtkSmartPointer<vtkImageData> volume;
  vtkNew<vtkOpticalMediumFilter> medium;
  vtkNew<vtkLightSeedFilter> seeds;
  vtkNew<Filter> light;
  vtkNew<MessageLog> warnings;

  explicit Pipeline(int nx = 23, int ny = 19, int nz = 17)
  {
    this->volume = makeImage(nx, ny, nz, VTK_FLOAT,
      [=](int i, int j, int k)
      {
        const double r = std::hypot(std::hypot(i - nx / 2, j - ny / 2), k - nz / 2);
        return r < 6. ? 100. : 0.;
      });
    this->medium->SetInputData(this->volume);
    this->medium->SetGradientScale(20.);
    this->seeds->SetInputConnection(this->medium->GetOutputPort());
    this->light->SetInputConnection(this->seeds->GetOutputPort());
    this->light->SetOutputPrecision(vtkAlgorithm::DOUBLE_PRECISION);
    this->light->AddObserver(vtkCommand::WarningEvent, this->warnings);
  }
  void lamp(double power, int shift = 0)
  {
    int dims[3];
    this->volume->GetDimensions(dims);
    const double* h = this->volume->GetSpacing();
    const int middle[3] = { dims[0] / 2 + shift, dims[1] / 2, dims[2] / 2 }; // a voxel's centre
    this->seeds->AddSphere(h[0] * middle[0], h[1] * middle[1], h[2] * middle[2], 0., power);
  }
  void expect(Suite& suite, const char* what, bool positive = true, double balance = 1e-6)
  {
    this->light->Update();
    vtkDataArray* phi = pointArray(this->light, "Fluence");
    bool finite = phi != nullptr;
    double least = 0.;
    double most = 0.;
    for (vtkIdType i = 0; phi && i < phi->GetNumberOfTuples(); ++i)
    {
      const double v = phi->GetComponent(i, 0);
      finite = finite && std::isfinite(v);
      least = std::min(least, v);
      most = std::max(most, v);
    }
    std::cout << what << ": " << this->light->GetStopReasonAsString() << ", "
              << this->light->GetNumberOfIterationsUsed() << " iterations, residual "
              << this->light->GetResidual() << ", fluence " << least << " to " << most << "\n";
    suite.check(finite, std::string(what) + ": finite", __FILE__, __LINE__);
    suite.check(this->light->GetStopReason() == Filter::Converged &&
        this->light->GetResidual() <= this->light->GetTolerance(),
      std::string(what) + ": converged", __FILE__, __LINE__);
    suite.check(!positive || -least <= this->light->GetTolerance() * most,
      std::string(what) + ": positive", __FILE__, __LINE__);
    const double scale = this->light->GetEmittedPower();
    suite.check(std::abs(this->light->GetAbsorbedPower() + this->light->GetEscapedPower() -
                  scale) <= balance * std::abs(scale),
      std::string(what) + ": balanced", __FILE__, __LINE__);
  }
};

void media(Suite& suite)
{
  for (const double floor : { 1e-8, 1e-4, 1. })
  {
    Pipeline p;
    p.lamp(1.);
    p.medium->SetGradientScale(2.); // the ball's surface is at the floor
    p.medium->SetBetaFloor(floor);
    p.medium->Update();
    double D[2];
    pointArray(p.medium, "DiffusionCoefficient")->GetRange(D);
    LT_CHECK_CLOSE(suite, D[0], floor * D[1], 1e-5);
    p.expect(suite, ("beta floor 1e" + std::to_string(std::lround(std::log10(floor)))).c_str());
  }
  for (const double albedo : { 0., 0.5, 1. - 1e-7 })
  {
    for (const double g : { -0.999, 0., 0.999 })
    {
      Pipeline p;
      p.lamp(1.);
      p.medium->SetAbsorptionMapping(vtkOpticalMediumFilter::FromAlbedo);
      p.medium->SetAlbedo(albedo);
      p.medium->SetAnisotropy(g);
      p.expect(suite, ("albedo " + std::to_string(albedo) + ", g " + std::to_string(g)).c_str());
    }
  }
  // hardly any absorption between mirrors: fluence is power / (sigma_a V), nearly everywhere
  for (const double g : { -0.999, 0., 0.999 })
  {
    Pipeline p;
    p.lamp(1.);
    p.medium->SetAbsorptionMapping(vtkOpticalMediumFilter::FromAlbedo);
    p.medium->SetAlbedo(1. - 1e-7);
    p.medium->SetAnisotropy(g);
    p.light->SetBoundary(Filter::ZeroFlux);
    p.expect(suite, ("albedo 1 - 1e-7, mirrors, g " + std::to_string(g)).c_str());
    vtkDataArray* sigma_a = pointArray(p.medium, "Absorption");
    double sum = 0.;
    for (vtkIdType i = 0; i < sigma_a->GetNumberOfTuples(); ++i)
    {
      sum += sigma_a->GetComponent(i, 0);
    }
    double range[2];
    pointArray(p.light, "Fluence")->GetRange(range);
    LT_CHECK(suite, range[0] * sum <= 1. + 1e-5 && range[1] * sum >= 1. - 1e-5);
    LT_CHECK(suite, g > 0.5 || range[0] * sum > 0.9);
  }
  for (const int boundary : { Filter::Robin, Filter::ZeroFlux, Filter::Absorbing })
  {
    Pipeline p;
    p.lamp(1.);
    p.medium->SetAbsorptionMapping(vtkOpticalMediumFilter::FromAlbedo);
    p.medium->SetAlbedo(1.);
    p.light->SetBoundary(boundary);
    if (boundary == Filter::ZeroFlux)
    {
      LT_CHECK_FAILS(suite, p.light.Get(), "no steady state");
      // both signs, and it exists
      p.lamp(-1., 3);
      p.light->Update();
      LT_CHECK(suite, p.light->GetStopReason() == Filter::Converged);
    }
    else
    {
      p.expect(suite, boundary == Filter::Robin ? "no absorption, Robin" : "no absorption, 0");
    }
  }
}

void geometry(Suite& suite)
{
  double reference = 0.;
  for (const double u : { 1., 1e-9, 1e9 })
  {
    Pipeline p;
    p.volume->SetSpacing(u, u, u);
    p.medium->SetGradientScale(20. / u);
    p.lamp(1.);
    p.expect(suite, ("spacing 1e" + std::to_string(std::lround(std::log10(u)))).c_str());
    // dimensionless: phi h^2 / power
    const double phi =
      pointArray(p.light, "Fluence")->GetComponent(p.volume->GetNumberOfPoints() / 2 + 2, 0) * u *
      u;
    reference = u == 1. ? phi : reference;
    LT_CHECK_CLOSE(suite, phi, reference, 1e-5);
  }
  for (int axis = 0; axis < 3; ++axis)
  {
    Pipeline p;
    double spacing[3] = { 1., 1., 1. };
    spacing[axis] = 1000.;
    p.volume->SetSpacing(spacing);
    p.lamp(1.);
    p.expect(suite, "spacing 1:1000");
  }
  const int shapes[][3] = { { 1, 1, 97 }, { 97, 1, 1 }, { 1, 101, 1 }, { 31, 1, 37 }, { 2, 3, 5 },
    { 53, 59, 2 }, { 1, 1, 1 } };
  for (const auto& n : shapes)
  {
    Pipeline p(n[0], n[1], n[2]);
    p.medium->SetReach(5.);
    p.lamp(1.);
    p.expect(suite,
      (std::to_string(n[0]) + "x" + std::to_string(n[1]) + "x" + std::to_string(n[2])).c_str());
  }
}

void powers(Suite& suite)
{
  for (const double power : { 1e-30, 1e30, -1e30 })
  {
    Pipeline p;
    p.lamp(power);
    p.expect(suite,
      (std::string("power ") +
        (power < 0       ? "-1e30"
            : power > 1. ? "1e30"
                         : "1e-30"))
        .c_str(),
      power > 0.);
  }
  {
    // 1e30 beside -1e-30: the small one is lost in the large one's rounding, and nothing else
    Pipeline p;
    p.lamp(1e30);
    p.lamp(-1e-30, 2);
    p.expect(suite, "powers 1e30 and -1e-30");
  }
  {
    Pipeline p;
    p.lamp(1e30);
    p.lamp(-1e30, 4);
    p.light->Update();
    LT_CHECK(suite, p.light->GetStopReason() == Filter::Converged);
    LT_CHECK_NEAR(suite, p.light->GetEmittedPower() / 1e30, 0., 1e-6);
  }
  {
    // what float cannot hold is an error that says so, in the sources and in the fluence
    Pipeline p;
    p.volume->SetSpacing(1e-9, 1e-9, 1e-9);
    p.medium->SetGradientScale(2e10);
    p.lamp(1e30);
    LT_CHECK_FAILS(suite, p.seeds.Get(), "float32");
  }
  {
    // denormals: refused where they are made, no light where they are given
    Pipeline p;
    p.lamp(1e-42);
    LT_CHECK_FAILS(suite, p.seeds.Get(), "float32");
    Pipeline given;
    given.lamp(1.);
    given.seeds->Update();
    vtkNew<vtkImageData> image;
    image->DeepCopy(given.seeds->GetOutput());
    image->GetPointData()->GetArray("Source")->Fill(1e-42);
    given.light->SetInputData(image);
    given.light->Update();
    LT_CHECK(suite, given.light->GetStopReason() == Filter::Converged);
    LT_CHECK_NEAR(suite, pointArray(given.light, "Fluence")->GetMaxNorm(), 0., 1e-35);
  }
}

void many(Suite& suite)
{
  std::mt19937 random(3);
  std::cout << "seed 3\n";
  std::uniform_real_distribution<double> uniform(0., 1.);
  {
    Pipeline p;
    for (int i = 0; i < 5000; ++i)
    {
      p.seeds->AddSphere(
        22. * uniform(random), 18. * uniform(random), 16. * uniform(random), 0.7, 1e-3);
    }
    p.expect(suite, "5000 lamps");
    LT_CHECK_CLOSE(suite, p.light->GetEmittedPower(), 5., 1e-5);
  }
  {
    Pipeline p;
    p.lamp(1.);
    p.seeds->Update();
    auto* q = vtkFloatArray::SafeDownCast(p.seeds->GetOutput()->GetPointData()->GetArray("Source"));
    vtkNew<vtkImageData> everywhere;
    everywhere->DeepCopy(p.seeds->GetOutput());
    auto* own = vtkFloatArray::SafeDownCast(everywhere->GetPointData()->GetArray("Source"));
    for (vtkIdType i = 0; i < q->GetNumberOfTuples(); ++i)
    {
      own->SetValue(i, static_cast<float>(uniform(random)));
    }
    p.light->SetInputData(everywhere);
    p.expect(suite, "a source in every voxel");
  }
}

void stops(Suite& suite)
{
  // a tolerance that double cannot reach: the honest reason, the best answer, one warning
  Pipeline p;
  p.lamp(1.);
  p.light->SetTolerance(1e-300);
  p.light->Update();
  LT_CHECK(suite,
    p.light->GetStopReason() == Filter::Breakdown ||
      p.light->GetStopReason() == Filter::MaxIterations);
  LT_CHECK(suite, p.light->GetResidual() < 1e-12 && p.light->GetResidual() > 0.);
  LT_CHECK(suite, p.warnings->messages.size() == 1);
  vtkDataArray* phi = pointArray(p.light, "Fluence");
  LT_CHECK(suite, phi && std::isfinite(phi->GetComponent(0, 0)));
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  Suite::trapFloatingPoint();
  media(suite);
  geometry(suite);
  powers(suite);
  many(suite);
  stops(suite);
  return suite.result();
}
