// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/** Memory is refused: one clear error, an empty output, and the filter works again afterwards. */
#include "LightTransportFilterTesting.h"

#include "vtkFloatArray.h"
#include "vtkLightDiffusionFilter.h"
#include "vtkLightSeedFilter.h"
#include "vtkLightTransportArrays.h"
#include "vtkOpticalMediumFilter.h"
#include "vtkSMPTools.h"
#include "vtkVisibilityFactorFilter.h"

#if defined(__linux__)
#include <malloc.h>
#include <sys/resource.h>
#endif
#include <fstream>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SANITIZED 1
#endif

using lighttransport::testing::makeImage;
using lighttransport::testing::Suite;

namespace
{
#if defined(__linux__) && !defined(SANITIZED)
/** While it lives, no more than `extra` bytes beyond what is mapped now can be had. */
class MemoryLimit
{
public:
  explicit MemoryLimit(std::size_t extra)
  {
    malloc_trim(0); // what was freed is not there to be had again
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    getrlimit(RLIMIT_AS, &this->before);
    rlimit limit = this->before;
    limit.rlim_cur = pages * 4096 + extra;
    setrlimit(RLIMIT_AS, &limit);
  }
  ~MemoryLimit() { setrlimit(RLIMIT_AS, &this->before); }
  MemoryLimit(const MemoryLimit&) = delete;
  MemoryLimit& operator=(const MemoryLimit&) = delete;

private:
  rlimit before;
};
#endif
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
#if !defined(__linux__) || defined(SANITIZED)
  std::cout << "memory cannot be limited here: skipped\n";
  return Suite::skipped();
#else
  constexpr int n = 160;
  auto volume = makeImage(n, n, n, VTK_UNSIGNED_CHAR,
    [](int i, int j, int k) { return (i / 40 + j / 40 + k / 40) % 2 ? 100. : 0.; });
  vtkNew<vtkOpticalMediumFilter> medium;
  medium->SetInputData(volume);
  vtkNew<vtkLightSeedFilter> seeds;
  seeds->SetInputConnection(medium->GetOutputPort());
  seeds->AddSphere(20., 20., 20., 3., 1.);
  vtkNew<vtkLightDiffusionFilter> filter;
  filter->SetInputConnection(seeds->GetOutputPort());
  filter->SetTolerance(1e-3);
  // once with memory, so that threads and their stacks are there
  filter->Update();
  LT_CHECK(suite, filter->GetStopReason() == vtkLightDiffusionFilter::Converged);
  const vtkIdType bytes = filter->GetBytes();
  std::cout << bytes / (n * n * n) << " bytes per voxel\n";

  {
    vtkNew<vtkLightDiffusionFilter> refused;
    refused->SetInputConnection(seeds->GetOutputPort());
    const MemoryLimit limit(static_cast<std::size_t>(bytes) / 3);
    LT_CHECK_FAILS(suite, refused.Get(), "not enough memory", "coarser");
  }
  {
    vtkNew<vtkOpticalMediumFilter> refused;
    // larger than what the allocator's arenas have set aside
    auto large = makeImage(1, 1, 1, VTK_UNSIGNED_CHAR, [](int, int, int) { return 0.; });
    large->SetDimensions(320, 320, 320);
    large->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
    large->GetPointData()->GetScalars()->Fill(1.);
    refused->SetInputData(large);
    const MemoryLimit limit(n * n * n);
    LT_CHECK_FAILS(suite, refused.Get(), "not enough memory");
  }
  {
    // An order too high for the memory there is, and one that fits.
    vtkNew<vtkVisibilityFactorFilter> visibility;
    visibility->SetInputConnection(medium->GetOutputPort());
    visibility->SetExtinctionArrayName(vtkLightTransportArrays::Absorption);
    visibility->SetNumberOfDirections(2);
    visibility->SetOrder(4);
    visibility->SetResolutionFactor(1);
    {
      const MemoryLimit limit(static_cast<std::size_t>(60) * n * n * n);
      LT_CHECK_FAILS(suite, visibility.Get(), "not enough memory", "Order 4", "lower order");
    }
    visibility->SetOrder(0);
    visibility->Update();
    LT_CHECK(suite, visibility->GetOutput()->GetNumberOfPoints() == n * n * n);
  }
  filter->Modified();
  filter->Update();
  LT_CHECK(suite, filter->GetStopReason() == vtkLightDiffusionFilter::Converged);
  return suite.result();
#endif
}
