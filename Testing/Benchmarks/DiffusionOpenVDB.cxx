// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "DiffusionCompetitors.h"

#include "Core/Watched.h"

#include <openvdb/openvdb.h>
#include <openvdb/tools/Dense.h>
#include <openvdb/tools/Morphology.h>
#include <openvdb/tools/PoissonSolver.h>
#include <tbb/global_control.h>

namespace lighttransport
{
namespace benchmark
{
Run SolveOpenVDB(const Problem& problem, double tolerance, int threads, std::vector<double>& phi)
{
  Run run;
  const tbb::global_control control(
    tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
  double began = now();
  const std::array<int, 3>& n = problem.grid.dims;
  const openvdb::CoordBBox box(openvdb::Coord(0), openvdb::Coord(n[0] - 1, n[1] - 1, n[2] - 1));
  // laplacian(phi) = -q, with zeros beyond the border.
  openvdb::DoubleTree source(0.);
  source.fill(box, 0., true);
  source.voxelizeActiveTiles();
  const int s = static_cast<int>(problem.seed);
  source.setValueOn(openvdb::Coord(s % n[0], s / n[0] % n[1], s / (n[0] * n[1])), -1.);
  run.assemble = now() - began;

  began = now();
  auto state = openvdb::math::pcg::terminationDefaults<double>();
  state.iterations = 5000;
  state.relativeError = tolerance;
  state.absoluteError = 0.;
  openvdb::util::NullInterrupter interrupter;
  // The border functor's default: phi = 0 at the centres beyond. Here the wall is
  // half a voxel away, as for the others: its conductance is 2 instead of 1.
  const auto border = [](const openvdb::Coord&, const openvdb::Coord&, double&, double& diagonal)
  { diagonal -= 2.; };
  const openvdb::DoubleTree::Ptr answer = openvdb::tools::poisson::solveWithBoundaryConditions(
    source, border, state, interrupter, /*staggered=*/true);
  run.solve = now() - began;
  run.iterations = state.iterations;
  if (!state.success)
  {
    run.failure = "OpenVDB did not converge";
    return run;
  }
  began = now();
  phi.resize(problem.q.size());
  openvdb::tools::Dense<double, openvdb::tools::LayoutXYZ> dense(box, phi.data());
  openvdb::tools::copyToDense(*answer, dense);
  run.assemble += now() - began;
  return run;
}

double GrowOpenVDB(const Problem& problem, const std::vector<std::uint8_t>& lit, double& seconds)
{
  const std::array<int, 3>& n = problem.grid.dims;
  const auto coordinate = [&n](std::int64_t i)
  {
    return openvdb::Coord(static_cast<int>(i % n[0]), static_cast<int>(i / n[0] % n[1]),
      static_cast<int>(i / (static_cast<std::int64_t>(n[0]) * n[1])));
  };
  openvdb::MaskTree open(false);
  for (std::size_t i = 0; i < lit.size(); ++i)
  {
    if (lit[i])
    {
      open.setValueOn(coordinate(static_cast<std::int64_t>(i)));
    }
  }
  const double began = now();
  openvdb::MaskTree grown(false);
  grown.setValueOn(coordinate(problem.seed));
  for (openvdb::Index64 before = 0; grown.activeVoxelCount() > before;)
  {
    before = grown.activeVoxelCount();
    openvdb::tools::dilateActiveValues(grown, 1, openvdb::tools::NN_FACE);
    grown.topologyIntersection(open);
  }
  seconds = now() - began;
  return static_cast<double>(grown.leafCount()) * openvdb::MaskTree::LeafNodeType::SIZE;
}
} // namespace benchmark
} // namespace lighttransport
