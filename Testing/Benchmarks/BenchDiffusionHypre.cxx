// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * hypre's conjugate gradients on a problem that bench-diffusion wrote, in double,
 * on as many MPI ranks as mpirun starts (Debian's hypre has no OpenMP):
 *
 *   mpirun -np 2 bench-diffusion-hypre PROBLEM pfmg|boomeramg TOLERANCE [SOLUTION]
 *
 * Each rank has a slab of z. Prints one line: seconds to fill and assemble the
 * matrix, of set-up, of the solve; iterations; bytes resident beyond the input
 * and CPU seconds of set-up and solve, all ranks together; and, of PFMG, seconds of a second
 * set-up and solve, with all of it anew in the heap that the first one left (-1: none). The
 * tolerance is for |b - A x| / |b| in the 2-norm.
 *
 * PFMG: one symmetric sweep of red-black Gauss-Seidel before and after, skipped on
 * levels where it may be, symmetric storage: of the 12 combinations of smoother,
 * Galerkin or not, and skipping, the one with the least time on both media at
 * 128^3, within what the machine's noise let tell.
 * BoomerAMG: HMIS coarsening with one aggressive level, extended+i
 * interpolation of at most 4 points, l1-Gauss-Seidel.
 */
#define OMPI_SKIP_MPICXX 1
#include "DiffusionProblem.h"

#include <HYPRE.h>
#include <HYPRE_IJ_mv.h>
#include <HYPRE_krylov.h>
#include <HYPRE_parcsr_ls.h>
#include <HYPRE_struct_ls.h>
#include <mpi.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fcntl.h>
#include <fstream>
#include <sys/mman.h>
#include <unistd.h>

#if defined(__GLIBC__)
#include <malloc.h>
#endif

using namespace lighttransport;
using namespace lighttransport::benchmark;

namespace
{
struct Slab
{
  int n[3];
  Boundary boundary;
  const float *D, *sigma_a, *q; // of the whole volume
  int z0, z1;

  std::int64_t plane() const { return static_cast<std::int64_t>(this->n[0]) * this->n[1]; }
  std::int64_t begin() const { return this->z0 * this->plane(); }
  std::int64_t size() const { return (this->z1 - this->z0) * this->plane(); }

  /** Voxel i's diagonal, and what stands in the columns i -+ 1, i -+ n, i -+ n^2 (0: none). */
  double row(std::int64_t i, double below[3], double above[3]) const
  {
    const int at[3] = { static_cast<int>(i % this->n[0]),
      static_cast<int>(i / this->n[0] % this->n[1]), static_cast<int>(i / this->plane()) };
    const std::int64_t stride[3] = { 1, this->n[0], this->plane() };
    const double Di = static_cast<double>(this->D[i]);
    double diagonal = static_cast<double>(this->sigma_a[i]);
    for (int d = 0; d < 3; ++d)
    {
      below[d] = 0.;
      above[d] = 0.;
      if (at[d] > 0)
      {
        below[d] = -FaceConductance(Di, static_cast<double>(this->D[i - stride[d]]));
      }
      if (at[d] + 1 < this->n[d])
      {
        above[d] = -FaceConductance(Di, static_cast<double>(this->D[i + stride[d]]));
      }
      diagonal -= below[d] + above[d];
      diagonal +=
        BorderSink(Di, this->boundary) * ((at[d] == 0 ? 1 : 0) + (at[d] + 1 == this->n[d] ? 1 : 0));
    }
    return diagonal;
  }
};

double residentBytes()
{
  std::ifstream file("/proc/self/statm");
  double pages = 0.;
  double resident = 0.;
  double shared = 0.;
  file >> pages >> resident >> shared;
  return (resident - shared) * static_cast<double>(sysconf(_SC_PAGESIZE));
}

double seconds()
{
  MPI_Barrier(MPI_COMM_WORLD);
  return MPI_Wtime();
}

double cpuSeconds()
{
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

struct Result
{
  double assemble = 0., setup = 0., solve = 0., bytes = 0.;
  double cpu = 0.; ///< of this rank, in set-up and solve
  int iterations = 0;
  std::vector<double> x;
};

Result solvePFMG(const Slab& slab, double tolerance)
{
  Result result;
  const double before = residentBytes();
  double began = seconds();
  int lower[3] = { 0, 0, slab.z0 };
  int upper[3] = { slab.n[0] - 1, slab.n[1] - 1, slab.z1 - 1 };
  HYPRE_StructGrid grid;
  HYPRE_StructGridCreate(MPI_COMM_WORLD, 3, &grid);
  HYPRE_StructGridSetExtents(grid, lower, upper);
  HYPRE_StructGridAssemble(grid);
  HYPRE_StructStencil stencil;
  HYPRE_StructStencilCreate(3, 4, &stencil);
  int offsets[4][3] = { { 0, 0, 0 }, { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } };
  for (int e = 0; e < 4; ++e)
  {
    HYPRE_StructStencilSetElement(stencil, e, offsets[e]);
  }
  HYPRE_StructMatrix A;
  HYPRE_StructMatrixCreate(MPI_COMM_WORLD, grid, stencil, &A);
  HYPRE_StructMatrixSetSymmetric(A, 1);
  HYPRE_StructMatrixInitialize(A);
  HYPRE_StructVector b;
  HYPRE_StructVector x;
  HYPRE_StructVectorCreate(MPI_COMM_WORLD, grid, &b);
  HYPRE_StructVectorCreate(MPI_COMM_WORLD, grid, &x);
  HYPRE_StructVectorInitialize(b);
  HYPRE_StructVectorInitialize(x);
  {
    // A plane at a time, so that the copies weigh nothing.
    std::vector<double> values(static_cast<std::size_t>(4 * slab.plane()));
    std::vector<double> q(static_cast<std::size_t>(slab.plane()));
    std::vector<double> zero(q.size(), 0.);
    int entries[4] = { 0, 1, 2, 3 };
    for (int z = slab.z0; z < slab.z1; ++z)
    {
      for (std::int64_t i = 0; i < slab.plane(); ++i)
      {
        double below[3];
        double above[3];
        const std::int64_t at = z * slab.plane() + i;
        values[static_cast<std::size_t>(4 * i)] = slab.row(at, below, above);
        for (int d = 0; d < 3; ++d)
        {
          values[static_cast<std::size_t>(4 * i + 1 + d)] = above[d];
        }
        q[static_cast<std::size_t>(i)] = static_cast<double>(slab.q[at]);
      }
      int low[3] = { 0, 0, z };
      int high[3] = { slab.n[0] - 1, slab.n[1] - 1, z };
      HYPRE_StructMatrixSetBoxValues(A, low, high, 4, entries, values.data());
      HYPRE_StructVectorSetBoxValues(b, low, high, q.data());
      HYPRE_StructVectorSetBoxValues(x, low, high, zero.data());
    }
  }
  HYPRE_StructMatrixAssemble(A);
  HYPRE_StructVectorAssemble(b);
  HYPRE_StructVectorAssemble(x);
  double now = seconds();
  result.assemble = now - began;

  began = now;
  const double cpuBegan = cpuSeconds();
  HYPRE_StructSolver pfmg;
  HYPRE_StructPFMGCreate(MPI_COMM_WORLD, &pfmg);
  HYPRE_StructPFMGSetMaxIter(pfmg, 1);
  HYPRE_StructPFMGSetTol(pfmg, 0.);
  HYPRE_StructPFMGSetZeroGuess(pfmg);
  HYPRE_StructPFMGSetRelaxType(pfmg, 2);
  HYPRE_StructPFMGSetRAPType(pfmg, 0);
  HYPRE_StructPFMGSetSkipRelax(pfmg, 1);
  HYPRE_StructPFMGSetNumPreRelax(pfmg, 1);
  HYPRE_StructPFMGSetNumPostRelax(pfmg, 1);
  HYPRE_StructSolver pcg;
  HYPRE_StructPCGCreate(MPI_COMM_WORLD, &pcg);
  HYPRE_StructPCGSetMaxIter(pcg, 500);
  HYPRE_StructPCGSetTol(pcg, tolerance);
  HYPRE_StructPCGSetTwoNorm(pcg, 1);
  HYPRE_StructPCGSetPrecond(pcg, HYPRE_StructPFMGSolve, HYPRE_StructPFMGSetup, pfmg);
  HYPRE_StructPCGSetup(pcg, A, b, x);
  now = seconds();
  result.setup = now - began;
  began = now;
  HYPRE_StructPCGSolve(pcg, A, b, x);
  result.solve = seconds() - began;
  result.cpu = cpuSeconds() - cpuBegan;
  result.bytes = residentBytes() - before;
  HYPRE_StructPCGGetNumIterations(pcg, &result.iterations);
  result.x.resize(static_cast<std::size_t>(slab.size()));
  HYPRE_StructVectorGetBoxValues(x, lower, upper, result.x.data());
  HYPRE_StructPCGDestroy(pcg);
  HYPRE_StructPFMGDestroy(pfmg);
  HYPRE_StructMatrixDestroy(A);
  HYPRE_StructVectorDestroy(b);
  HYPRE_StructVectorDestroy(x);
  HYPRE_StructStencilDestroy(stencil);
  HYPRE_StructGridDestroy(grid);
  return result;
}

Result solveBoomerAMG(const Slab& slab, double tolerance)
{
  Result result;
  const double before = residentBytes();
  double began = seconds();
  const HYPRE_BigInt first = static_cast<HYPRE_BigInt>(slab.begin());
  const HYPRE_BigInt last = static_cast<HYPRE_BigInt>(slab.begin() + slab.size() - 1);
  HYPRE_IJMatrix A;
  HYPRE_IJMatrixCreate(MPI_COMM_WORLD, first, last, first, last, &A);
  HYPRE_IJMatrixSetObjectType(A, HYPRE_PARCSR);
  {
    const std::vector<int> sizes(static_cast<std::size_t>(slab.size()), 7);
    HYPRE_IJMatrixSetRowSizes(A, sizes.data());
  }
  HYPRE_IJMatrixInitialize(A);
  HYPRE_IJVector b;
  HYPRE_IJVector x;
  HYPRE_IJVectorCreate(MPI_COMM_WORLD, first, last, &b);
  HYPRE_IJVectorCreate(MPI_COMM_WORLD, first, last, &x);
  for (HYPRE_IJVector v : { b, x })
  {
    HYPRE_IJVectorSetObjectType(v, HYPRE_PARCSR);
    HYPRE_IJVectorInitialize(v);
  }
  const std::int64_t stride[3] = { 1, slab.n[0], slab.plane() };
  for (std::int64_t i = slab.begin(); i < slab.begin() + slab.size(); ++i)
  {
    double below[3];
    double above[3];
    double values[7];
    HYPRE_BigInt columns[7];
    int count = 1;
    values[0] = slab.row(i, below, above);
    columns[0] = static_cast<HYPRE_BigInt>(i);
    for (int d = 0; d < 3; ++d)
    {
      if (below[d] != 0.)
      {
        values[count] = below[d];
        columns[count++] = static_cast<HYPRE_BigInt>(i - stride[d]);
      }
      if (above[d] != 0.)
      {
        values[count] = above[d];
        columns[count++] = static_cast<HYPRE_BigInt>(i + stride[d]);
      }
    }
    const HYPRE_BigInt row = static_cast<HYPRE_BigInt>(i);
    HYPRE_IJMatrixSetValues(A, 1, &count, &row, columns, values);
    const double q = static_cast<double>(slab.q[i]);
    const double zero = 0.;
    HYPRE_IJVectorSetValues(b, 1, &row, &q);
    HYPRE_IJVectorSetValues(x, 1, &row, &zero);
  }
  HYPRE_IJMatrixAssemble(A);
  HYPRE_IJVectorAssemble(b);
  HYPRE_IJVectorAssemble(x);
  HYPRE_ParCSRMatrix parA;
  HYPRE_ParVector parB;
  HYPRE_ParVector parX;
  HYPRE_IJMatrixGetObject(A, reinterpret_cast<void**>(&parA));
  HYPRE_IJVectorGetObject(b, reinterpret_cast<void**>(&parB));
  HYPRE_IJVectorGetObject(x, reinterpret_cast<void**>(&parX));
  double now = seconds();
  result.assemble = now - began;

  began = now;
  const double cpuBegan = cpuSeconds();
  HYPRE_Solver amg;
  HYPRE_BoomerAMGCreate(&amg);
  HYPRE_BoomerAMGSetMaxIter(amg, 1);
  HYPRE_BoomerAMGSetTol(amg, 0.);
  HYPRE_BoomerAMGSetCoarsenType(amg, 10);
  HYPRE_BoomerAMGSetAggNumLevels(amg, 1);
  HYPRE_BoomerAMGSetInterpType(amg, 6);
  HYPRE_BoomerAMGSetPMaxElmts(amg, 4);
  HYPRE_BoomerAMGSetStrongThreshold(amg, 0.25);
  HYPRE_BoomerAMGSetRelaxType(amg, 8);
  HYPRE_BoomerAMGSetPrintLevel(amg, 0);
  HYPRE_Solver pcg;
  HYPRE_ParCSRPCGCreate(MPI_COMM_WORLD, &pcg);
  HYPRE_PCGSetMaxIter(pcg, 500);
  HYPRE_PCGSetTol(pcg, tolerance);
  HYPRE_PCGSetTwoNorm(pcg, 1);
  HYPRE_PCGSetPrecond(pcg, reinterpret_cast<HYPRE_PtrToSolverFcn>(HYPRE_BoomerAMGSolve),
    reinterpret_cast<HYPRE_PtrToSolverFcn>(HYPRE_BoomerAMGSetup), amg);
  HYPRE_ParCSRPCGSetup(pcg, parA, parB, parX);
  now = seconds();
  result.setup = now - began;
  began = now;
  HYPRE_ParCSRPCGSolve(pcg, parA, parB, parX);
  result.solve = seconds() - began;
  result.cpu = cpuSeconds() - cpuBegan;
  result.bytes = residentBytes() - before;
  HYPRE_PCGGetNumIterations(pcg, &result.iterations);
  result.x.resize(static_cast<std::size_t>(slab.size()));
  std::vector<HYPRE_BigInt> rows(result.x.size());
  for (std::size_t i = 0; i < rows.size(); ++i)
  {
    rows[i] = first + static_cast<HYPRE_BigInt>(i);
  }
  HYPRE_IJVectorGetValues(x, static_cast<HYPRE_Int>(rows.size()), rows.data(), result.x.data());
  return result;
}
} // namespace

int main(int argc, char* argv[])
{
#if defined(__GLIBC__)
  // The heap keeps what is freed: the second solve finds its memory there.
  mallopt(M_MMAP_MAX, 0);
  mallopt(M_TRIM_THRESHOLD, -1); // never
#endif
  MPI_Init(&argc, &argv);
  HYPRE_Init();
  int rank = 0;
  int ranks = 1;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  const auto fail = [](const char* what)
  {
    std::fprintf(stderr, "bench-diffusion-hypre: %s\n", what);
    MPI_Abort(MPI_COMM_WORLD, 1);
    return 1;
  };
  if (argc < 4)
  {
    return fail("expected PROBLEM pfmg|boomeramg TOLERANCE [SOLUTION]");
  }
  const int file = open(argv[1], O_RDONLY);
  std::int32_t header[4];
  if (file < 0 || read(file, header, sizeof header) != static_cast<ssize_t>(sizeof header))
  {
    return fail("the problem cannot be read");
  }
  Slab slab;
  for (int d = 0; d < 3; ++d)
  {
    slab.n[d] = header[d];
  }
  slab.boundary = static_cast<Boundary>(header[3]);
  const std::size_t count = static_cast<std::size_t>(slab.plane() * slab.n[2]);
  void* mapped = mmap(nullptr, sizeof header + 3 * count * sizeof(float), PROT_READ,
    MAP_SHARED | MAP_POPULATE, file, 0);
  if (mapped == MAP_FAILED)
  {
    return fail("the problem cannot be mapped");
  }
  slab.D = reinterpret_cast<const float*>(static_cast<const char*>(mapped) + sizeof header);
  slab.sigma_a = slab.D + count;
  slab.q = slab.sigma_a + count;
  slab.z0 = slab.n[2] * rank / ranks;
  slab.z1 = slab.n[2] * (rank + 1) / ranks;

  const double tolerance = std::atof(argv[3]);
  const bool pfmg = std::strcmp(argv[2], "pfmg") == 0;
  Result result = pfmg ? solvePFMG(slab, tolerance) : solveBoomerAMG(slab, tolerance);
  double again = -1.;
  if (pfmg)
  {
    const Result second = solvePFMG(slab, tolerance);
    again = second.setup + second.solve;
  }
  double bytes = 0.;
  MPI_Reduce(&result.bytes, &bytes, 1, MPI_DOUBLE, MPI_SUM, 0, MPI_COMM_WORLD);
  double cpu = 0.;
  MPI_Reduce(&result.cpu, &cpu, 1, MPI_DOUBLE, MPI_SUM, 0, MPI_COMM_WORLD);
  if (argc > 4)
  {
    const int out = open(argv[4], O_WRONLY | O_CREAT, 0644);
    const char* at = reinterpret_cast<const char*>(result.x.data());
    std::size_t left = result.x.size() * sizeof(double);
    off_t where = static_cast<off_t>(slab.begin()) * static_cast<off_t>(sizeof(double));
    while (out >= 0 && left > 0)
    {
      const ssize_t done = pwrite(out, at, left, where);
      if (done <= 0)
      {
        return fail("the solution cannot be written");
      }
      at += done;
      where += done;
      left -= static_cast<std::size_t>(done);
    }
    close(out);
  }
  MPI_Barrier(MPI_COMM_WORLD);
  if (rank == 0)
  {
    std::printf("%.6f %.6f %.6f %d %.0f %.6f %.6f\n", result.assemble, result.setup, result.solve,
      result.iterations, bytes, cpu, again);
  }
  // What hypre holds goes with the process.
  MPI_Finalize();
  return 0;
}
