// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * The diffusion solver against its floor and its competitors, all in one run and
 * in turn, so that their quotients mean something on a busy machine.
 *
 *   bench-diffusion [--output FOLDER] [--sizes 32,64,96,128,256] [--media 1,2,3]
 *     [--threads 1,2] [--repeat 5] [--tolerance 1e-6] [--sections floor,step,error,solve]
 *     [--error-size 128] [--large] [--quick]
 *
 * Prints tables of Markdown and leaves the same numbers as CSV in FOLDER:
 *   floor  STREAM's triad; what share of it the explicit step and a Jacobi sweep reach
 *   step   one explicit step, beside table 4.1 of the source thesis
 *   error  the true error against time, for every knob that trades them
 *   solve  the steady solve at growing sizes: this solver, hypre, Eigen, OpenVDB, Jacobi
 *   constant  of these, the medium that is the same everywhere alone (solve has it up to 256^3)
 * --large adds 384^3 (and 512^3 for this solver alone) with at most 3 repeats;
 * --quick is a smoke test: tiny sizes, once. Times are medians of the repeats, quotients
 * are medians of each repeat's own. Exits with 1 if this solver misses the
 * tolerance anywhere, whatever the times are. bench-diffusion.sh builds, runs, and draws.
 */
#include "DiffusionCompetitors.h"
#include "DiffusionSweeps.h"

#include "vtkLightTransportInternal.h"

#include "vtkSMPTools.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <sstream>

#if defined(__GLIBC__)
#include <malloc.h>
#endif

using namespace lighttransport;
using namespace lighttransport::benchmark;

namespace
{
struct Options
{
  std::string output = "bench-diffusion";
  std::vector<int> sizes{ 32, 64, 96, 128, 256 };
  std::vector<int> media{ 1, 2, 3 };
  std::vector<int> threads{ 1, 2 };
  std::vector<int> stepSizes{ 128, 256, 512 };
  std::vector<int> floorSizes{ 128, 256 };
  std::vector<std::string> sections{ "floor", "step", "error", "solve" };
  int repeat = 5;
  int errorSize = 128;
  double tolerance = 1e-6;
  std::int64_t triadLength = 32 << 20;
  int largestHypre = 384;
  bool quick = false;
  std::string folderOfProgram;

  int most() const { return *std::max_element(this->threads.begin(), this->threads.end()); }
  bool has(const char* section) const
  {
    return std::find(this->sections.begin(), this->sections.end(), section) != this->sections.end();
  }
};

const MediumRecipe Recipes[] = { { 1e4, .99 }, { 1e6, .999 } };

double now()
{
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/** Of this process, all threads together. */
double CpuSeconds()
{
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

double median(std::vector<double> values)
{
  if (values.empty())
  {
    return std::nan("");
  }
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

/** The filters' own parallel-for; from now on vtkSMPTools has so many threads. */
ParallelFor OnThreads(int threads)
{
  vtkSMPTools::Initialize(threads);
  return vtkLightTransportParallelFor();
}

std::string load()
{
  double average[3] = { -1., -1., -1. };
  if (getloadavg(average, 3) != 3)
  {
    return "unknown";
  }
  char text[64];
  std::snprintf(text, sizeof text, "%.2f %.2f %.2f", average[0], average[1], average[2]);
  return text;
}

/** A number after "key:" in a file of /proc; -1 without. */
double fromProc(const char* file, const std::string& key)
{
  std::ifstream in(file);
  std::string line;
  while (std::getline(in, line))
  {
    if (line.compare(0, key.size(), key) == 0)
    {
      return std::atof(line.c_str() + line.find(':') + 1);
    }
  }
  return -1.;
}

/** Bytes by which the process grew at most while f ran; -1 if the system does not tell. */
double PeakGrowth(const std::function<void()>& f)
{
#if defined(__GLIBC__)
  malloc_trim(0);
#endif
  {
    std::ofstream clear("/proc/self/clear_refs");
    clear << 5;
    if (!clear.flush())
    {
      return -1.;
    }
  }
  const double before = fromProc("/proc/self/status", "VmRSS");
  f();
  const double peak = fromProc("/proc/self/status", "VmHWM");
  return before < 0. || peak < 0. ? -1. : 1024. * (peak - before);
}

std::string number(double value, const char* format)
{
  char text[40];
  std::snprintf(text, sizeof text, format, value);
  return value != value || value < 0. ? "" : text;
}

/** Comma-separated values, each line on disk at once. */
class Table
{
public:
  Table(const Options& options, const char* name, const char* head)
    : file(options.output + "/" + name + ".csv")
  {
    this->file << head << std::endl;
  }
  template <class... Values>
  void add(const Values&... values)
  {
    std::ostringstream line;
    line.precision(9);
    const char* comma = "";
    ((line << comma << values, comma = ","), ...);
    this->file << line.str() << std::endl;
  }

private:
  std::ofstream file;
};

//------------------------------------------------------------------------------
/** Memory that is freed stays with the process while one lives. */
class KeepHeap
{
public:
#if defined(__GLIBC__)
  KeepHeap()
  {
    mallopt(M_MMAP_MAX, 0);
    mallopt(M_TRIM_THRESHOLD, -1); // never
  }
  ~KeepHeap()
  {
    mallopt(M_MMAP_MAX, 65536);
    mallopt(M_TRIM_THRESHOLD, 128 * 1024);
    malloc_trim(0);
  }
#else
  KeepHeap() = default;
#endif
  KeepHeap(const KeepHeap&) = delete;
  KeepHeap& operator=(const KeepHeap&) = delete;
};

/**
 * Keeps all threads busy for a while, so that the system has spread them over the cores when a
 * measurement begins: hypre's ranks have just filled their matrices then.
 */
void WakeThreads(int threads)
{
  const ParallelFor parallelFor = OnThreads(threads);
  const double end = now() + 0.2;
  parallelFor(threads,
    [end](std::int64_t, std::int64_t)
    {
      while (now() < end)
      {
      }
    });
}

/** This project's solver from D and sigma_a to phi: all of it counts. */
Run SolveOurs(const Problem& problem, double tolerance, int threads, std::vector<double>& phi,
  bool iterate = false)
{
  Run run;
  phi.assign(problem.q.size(), 0.);
  const std::vector<std::uint8_t> nothing(iterate ? problem.q.size() : 0, 0);
  const ParallelFor parallelFor = OnThreads(threads);
  const double cpuBegan = CpuSeconds();
  const double began = now();
  DiffusionSolver solver(parallelFor);
  DiffusionMedium<float> described = problem.medium();
  described.outside = iterate ? nothing.data() : nullptr; // then no medium is taken for constant
  const DiffusionReport medium = solver.setMedium(described);
  run.setup = now() - began;
  DiffusionControl control;
  control.tolerance = tolerance;
  const DiffusionReport report = solver.solveSteady(problem.q.data(), phi.data(), control);
  run.solve = now() - began - run.setup;
  run.cpu = CpuSeconds() - cpuBegan;
  run.iterations = report.iterations;
  run.applications = report.fineApplications;
  run.bytes = static_cast<double>(std::max(medium.bytes, report.bytes));
  if (report.reason != StopReason::Converged)
  {
    run.failure = ToString(report.reason);
  }
  return run;
}

/** First in fresh memory, then in a heap where another solve has left its memory. */
Run SolveOursTwice(const Problem& problem, double tolerance, int threads, std::vector<double>& phi)
{
  WakeThreads(threads);
  Run run = SolveOurs(problem, tolerance, threads, phi);
  const KeepHeap keep;
  SolveOurs(problem, tolerance, threads, phi);
  run.again = SolveOurs(problem, tolerance, threads, phi).seconds();
  return run;
}

/** hypre's in a process of its own, since it needs MPI to use two cores. */
class Hypre
{
public:
  Hypre(const Options& o, const Problem& problem)
    : options(o)
  {
    this->path = o.output + "/problem.tmp";
    std::ofstream file(this->path, std::ios::binary);
    const std::int32_t header[4] = { problem.grid.dims[0], problem.grid.dims[1],
      problem.grid.dims[2], static_cast<std::int32_t>(problem.boundary) };
    file.write(reinterpret_cast<const char*>(header), sizeof header);
    for (const std::vector<float>* values : { &problem.D, &problem.sigma_a, &problem.q })
    {
      file.write(reinterpret_cast<const char*>(values->data()),
        static_cast<std::streamsize>(values->size() * sizeof(float)));
    }
  }
  ~Hypre() { std::remove(this->path.c_str()); }
  Hypre(const Hypre&) = delete;
  Hypre& operator=(const Hypre&) = delete;

  static bool available()
  {
#ifdef BENCH_MPIEXEC
    return true;
#else
    return false;
#endif
  }

  /** With phi, also fetches the solution. */
  Run solve(const char* kind, double tolerance, int ranks, std::vector<double>* phi) const
  {
    Run run;
#ifdef BENCH_MPIEXEC
    const std::string solution = this->path + ".solution";
    std::ostringstream command;
    command << BENCH_MPIEXEC << " " << ranks << " '" << this->options.folderOfProgram
            << "bench-diffusion-hypre' '" << this->path << "' " << kind << " " << tolerance;
    if (phi)
    {
      command << " '" << solution << "'";
    }
    FILE* pipe = popen(command.str().c_str(), "r");
    char line[256] = "";
    if (!pipe || !std::fgets(line, sizeof line, pipe) ||
      std::sscanf(line, "%lf %lf %lf %d %lf %lf %lf", &run.assemble, &run.setup, &run.solve,
        &run.iterations, &run.bytes, &run.cpu, &run.again) != 7)
    {
      run.failure = "no answer from bench-diffusion-hypre";
    }
    if (pipe && pclose(pipe) != 0)
    {
      run.failure = "bench-diffusion-hypre failed";
    }
    if (phi && run.failure.empty())
    {
      std::ifstream file(solution, std::ios::binary);
      file.read(reinterpret_cast<char*>(phi->data()),
        static_cast<std::streamsize>(phi->size() * sizeof(double)));
      if (!file)
      {
        run.failure = "no solution from bench-diffusion-hypre";
      }
    }
    std::remove(solution.c_str());
#else
    (void)kind, (void)tolerance, (void)ranks, (void)phi;
    run.failure = "built without hypre";
#endif
    return run;
  }

private:
  const Options& options;
  std::string path;
};

/** 200 sweeps from zero; the time is the sweeps' alone. */
Run SolveJacobi(const Problem& problem, int threads, std::vector<double>& phi)
{
  Run run;
  const ParallelFor parallelFor = OnThreads(threads);
  const double began = now();
  Jacobi jacobi(problem, parallelFor);
  run.setup = now() - began;
  run.iterations = 200;
  run.applications = run.iterations;
  for (int i = 0; i < run.iterations; ++i)
  {
    jacobi.sweep(parallelFor);
  }
  run.solve = now() - began - run.setup;
  phi.assign(jacobi.phi().data(), jacobi.phi().data() + jacobi.phi().size());
  return run;
}

//------------------------------------------------------------------------------
/** ms of one explicit step: that of many less that of one, so that a call's other passes cancel. */
double StepSeconds(
  DiffusionSolver& solver, const Problem& problem, std::vector<double>& phi, int more)
{
  DiffusionControl control;
  control.tolerance = 0.;
  const double cdt = 0.5 * solver.stabilityBound();
  double seconds[2];
  for (int i = 0; i < 2; ++i)
  {
    // The same parity, since an odd number of steps ends with a copy.
    const double began = now();
    solver.stepExplicit(problem.q.data(), phi.data(), i ? 2 + more : 2, cdt, control);
    seconds[i] = now() - began;
  }
  return (seconds[1] - seconds[0]) / more;
}

/** phi in and out in double, 4 floats of the operator, q. */
constexpr double ExplicitBytes = 36.;

/** Returns the triad's bytes per second on the most threads. */
double MeasureFloor(const Options& options)
{
  Table csv(
    options, "floor", "kind,size,threads,bytes_per_voxel,seconds,gb_per_s,percent_of_triad");
  std::printf(
    "\n## Floor: what memory allows\n\n"
    "Bytes that must move, without write-allocates, as STREAM counts; above 100 %% means that "
    "part of the arrays stays in the cache, as it does for explicit steps, of which four go "
    "through "
    "the memory in one pass. Arrays of the triad: "
    "%.0f MB each.\n\n"
    "| kernel | size | threads | bytes / voxel | ms | GB/s | of triad |\n"
    "|---|---|---|---|---|---|---|\n",
    8e-6 * static_cast<double>(options.triadLength));
  double result = 0.;
  for (const int threads : options.threads)
  {
    const ParallelFor parallelFor = OnThreads(threads);
    Triad triad(options.triadLength, parallelFor);
    std::vector<double> triadSeconds;
    struct Sweep
    {
      int n;
      std::vector<double> step, jacobi;
    };
    std::vector<Sweep> sweeps;
    for (const int n : options.floorSizes)
    {
      sweeps.push_back({ n, {}, {} });
      const Problem problem = MakeProblem(n, Recipes[0], parallelFor);
      DiffusionSolver solver(parallelFor);
      solver.setMedium(problem.medium());
      Jacobi jacobi(problem, parallelFor);
      jacobi.sweep(parallelFor);
      std::vector<double> phi(problem.q.size(), 0.);
      const int more = n >= 200 ? 4 : 20;
      for (int i = 0; i < options.repeat; ++i)
      {
        for (int j = 0; j < 3; ++j)
        {
          triadSeconds.push_back(triad.pass(parallelFor));
        }
        sweeps.back().step.push_back(StepSeconds(solver, problem, phi, more));
        const double began = now();
        for (int j = 0; j < more; ++j)
        {
          jacobi.sweep(parallelFor);
        }
        sweeps.back().jacobi.push_back((now() - began) / more);
      }
    }
    const double seconds = median(triadSeconds);
    const double bandwidth = triad.bytes() / seconds;
    std::printf("| STREAM triad | | %d | 24 | %.1f | %.1f | best %.1f |\n", threads, 1e3 * seconds,
      1e-9 * bandwidth,
      1e-9 * triad.bytes() / *std::min_element(triadSeconds.begin(), triadSeconds.end()));
    csv.add("triad", "", threads, 24, seconds, 1e-9 * bandwidth, 100);
    for (const Sweep& sweep : sweeps)
    {
      const double voxels = std::pow(sweep.n, 3.);
      const auto line = [&](const char* kind, double bytes, double s)
      {
        const double gb = 1e-9 * bytes * voxels / s;
        const double percent = 1e11 * gb / bandwidth;
        std::printf("| %s | %d³ | %d | %.0f | %.2f | %.1f | %.0f %% |\n", kind, sweep.n, threads,
          bytes, 1e3 * s, gb, percent);
        csv.add(kind, sweep.n, threads, bytes, s, gb, percent);
      };
      line("stepExplicit (double)", ExplicitBytes, median(sweep.step));
      line("Jacobi sweep (float)", Jacobi::BytesPerVoxel, median(sweep.jacobi));
    }
    std::fflush(stdout);
    result = threads == options.most() ? bandwidth : result;
  }
  return result;
}

//------------------------------------------------------------------------------
void MeasureSteps(const Options& options)
{
  Table csv(options, "step", "size,threads,seconds,thesis_overhead_ms");
  const int threads = options.most();
  const ParallelFor parallelFor = OnThreads(threads);
  // Murray 2018, table 4.1, column "Diffusion overhead".
  const std::map<int, double> thesis{ { 128, 2.5 }, { 256, 15.6 }, { 512, 107.2 },
    { 1024, 709.4 } };
  std::printf("\n## One explicit step (the source thesis's table 4.1)\n\n"
              "The thesis's column is its diffusion overhead per frame on a Quadro M5000M (GPU); "
              "here %d CPU threads, phi in double.\n\n"
              "| size | ms per step | ns per voxel | thesis, ms |\n|---|---|---|---|\n",
    threads);
  double perVoxel = 0.;
  for (const int n : options.stepSizes)
  {
    const double voxels = std::pow(n, 3.);
    const double available = 1024. * fromProc("/proc/meminfo", "MemAvailable");
    if (available > 0. && available < 60. * voxels)
    {
      std::printf("| %d³ | | | not enough memory here |\n", n);
      continue;
    }
    Problem problem;
    problem.grid.dims = { { n, n, n } };
    const std::size_t count = static_cast<std::size_t>(problem.grid.size());
    problem.D.resize(count);
    problem.sigma_a.assign(count, .01f);
    problem.q.assign(count, 0.f);
    problem.q[count / 2] = 1.f;
    for (std::size_t i = 0; i < count; ++i)
    {
      problem.D[i] = 1.f / static_cast<float>(1 + i % 7);
    }
    DiffusionSolver solver(parallelFor);
    solver.setMedium(problem.medium());
    std::vector<double> phi(count, 0.);
    std::vector<double> seconds;
    StepSeconds(solver, problem, phi, 4); // touches the memory
    for (int i = 0; i < (n > 400 ? std::min(3, options.repeat) : options.repeat); ++i)
    {
      seconds.push_back(StepSeconds(solver, problem, phi, n > 200 ? 4 : 20));
    }
    const double s = median(seconds);
    perVoxel = s / voxels;
    const auto beside = thesis.find(n);
    std::printf("| %d³ | %.2f | %.2f | %s |\n", n, 1e3 * s, 1e9 * perVoxel,
      beside == thesis.end() ? "" : number(beside->second, "%.1f").c_str());
    csv.add(n, threads, s, beside == thesis.end() ? 0. : beside->second);
    std::fflush(stdout);
  }
  const double s = perVoxel * std::pow(1024., 3.);
  std::printf("| 1024³ (extrapolated) | %.0f | %.2f | 709.4 |\n", 1e3 * s, 1e9 * perVoxel);
  csv.add(1024, threads, s, 709.4);
  std::fflush(stdout);
}

//------------------------------------------------------------------------------
/** What trades time for error. One value of it gives one solution. */
struct Knob
{
  std::string name;
  std::vector<double> values;
  std::function<Run(const Problem& problem, double value, std::vector<double>& phi)> solve;
};

void MeasureErrors(const Options& options)
{
  const int n = options.errorSize;
  const int threads = options.most();
  const ParallelFor parallelFor = OnThreads(threads);
  Table csv(options, "error",
    "medium,knob,value,size,threads,seconds,cpu_seconds,iterations,residual,p95,relative_l2,bytes_"
    "per_voxel");
  std::printf(
    "\n## Error against time, %d³, %d threads\n\n"
    "p95: 95th percentile of |phi - phi*| / |phi*| over the voxels within 6 decades of the "
    "maximum; L2: relative; phi*: refined in double to a residual of 1e-12.\n\n"
    "| medium | knob | value | s | CPU s | iterations | residual | p95 | L2 | bytes / voxel |\n"
    "|---|---|---|---|---|---|---|---|---|---|\n",
    n, threads);
  for (const MediumRecipe& recipe : Recipes)
  {
    const Problem problem = MakeProblem(n, recipe, parallelFor);
    const Hypre hypre(options, problem);
    double reached = 0.;
    const std::vector<double> reference = ReferenceSolution(problem, reached, parallelFor);
    if (!(reached <= 1e-12))
    {
      std::printf(
        "| %s | reference | reached only %.1e | | | | | | | |\n", problem.name.c_str(), reached);
    }
    // Further knobs (grid, region, precision) are further entries here.
    std::vector<Knob> knobs;
    knobs.push_back({ "tolerance", { 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10 },
      [&](const Problem& p, double value, std::vector<double>& phi)
      { return SolveOurs(p, value, threads, phi); } });
    if (Hypre::available())
    {
      knobs.push_back({ "tolerance of hypre PCG+PFMG", { 1e-2, 1e-4, 1e-6, 1e-8, 1e-10 },
        [&](const Problem&, double value, std::vector<double>& phi)
        { return hypre.solve("pfmg", value, threads, &phi); } });
    }
    for (const Knob& knob : knobs)
    {
      std::vector<std::vector<double>> seconds(knob.values.size());
      std::vector<std::vector<double>> cpu(knob.values.size());
      std::vector<Run> last(knob.values.size());
      std::vector<double> phi(problem.q.size());
      for (int i = 0; i < options.repeat; ++i)
      {
        for (std::size_t v = 0; v < knob.values.size(); ++v)
        {
          std::fill(phi.begin(), phi.end(), 0.);
          const double cpuBegan = CpuSeconds();
          last[v] = knob.solve(problem, knob.values[v], phi);
          seconds[v].push_back(last[v].seconds());
          cpu[v].push_back(last[v].cpu < 0. ? CpuSeconds() - cpuBegan : last[v].cpu);
          if (i + 1 == options.repeat)
          {
            last[v].residual = Residual(problem, phi.data(), nullptr, parallelFor);
            last[v].errors = FindErrors(phi.data(), reference);
          }
        }
      }
      for (std::size_t v = 0; v < knob.values.size(); ++v)
      {
        const Run& run = last[v];
        const double s = median(seconds[v]);
        const double bytes = run.bytes / static_cast<double>(problem.grid.size());
        std::printf("| %s | %s | %.0e | %.3f | %.3f | %d | %.1e | %.1e | %.1e | %.0f %s|\n",
          problem.name.c_str(), knob.name.c_str(), knob.values[v], s, median(cpu[v]),
          run.iterations, run.residual, run.errors.p95, run.errors.relativeL2, bytes,
          run.failure.empty() ? "" : (run.failure + " ").c_str());
        csv.add('"' + problem.name + '"', knob.name, knob.values[v], n, threads, s, median(cpu[v]),
          run.iterations, run.residual, run.errors.p95, run.errors.relativeL2, bytes);
      }
      std::fflush(stdout);
    }
  }
}

//------------------------------------------------------------------------------
struct Entry
{
  std::string solver;
  int threads;
  /** phi holds the solution if the run says so by a true `judge`. */
  std::function<Run(std::vector<double>& phi, bool judge)> solve;
  std::vector<Run> runs;

  std::vector<double> seconds() const
  {
    std::vector<double> s;
    for (const Run& run : this->runs)
    {
      s.push_back(run.seconds());
    }
    return s;
  }
  double again() const
  {
    std::vector<double> s;
    for (const Run& run : this->runs)
    {
      s.push_back(run.again);
    }
    return median(s);
  }
  double cpu() const
  {
    std::vector<double> s;
    for (const Run& run : this->runs)
    {
      s.push_back(run.cpu);
    }
    return median(s);
  }
};

/** HPGMG's count for a full multigrid solve, and the bytes of an application in float. */
constexpr double FloorApplications = 13.;
constexpr double FloorBytes = 24.; // 3 faces, sink, x in, y out

/** False if this solver has not kept its promise somewhere. */
bool MeasureSolves(const Options& options, double triad)
{
  Table csv(options, "solve",
    "medium,size,solver,threads,seconds,seconds_min,seconds_max,again,cpu_seconds,assemble,setup,"
    "solve,"
    "iterations,applications,bytes_per_voxel,resident_per_voxel,residual,p95,relative_l2,repeats");
  std::printf(
    "\n## The steady solve, relative residual %.0e\n\n"
    "s: set-up + solve (hypre's and Eigen's filling of the matrix, OpenVDB's of the tree are not "
    "in it; D to phi for this solver), in memory that is fresh from the system; again: the same in "
    "a heap that a solve before it has left. Residual: |q - A phi| / |q| in double by the same "
    "function "
    "for all (OpenVDB stops by the maximum norm, the others by this one). Bytes beyond the input, "
    "phi included: as the solver tells (hypre: resident). "
    "Errors as above.\n\n"
    "| size | medium | solver | threads | s | min - max | again, s | CPU s | assembly | iterations "
    "| fine applications | residual | L2 | p95 | bytes / voxel | ns / voxel | again |\n"
    "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    options.tolerance);
  std::ostringstream summary;
  bool kept = true;
  const int threads = options.most();
  const ParallelFor parallelFor = OnThreads(threads);
  for (const int n : options.sizes)
  {
    std::vector<MediumRecipe> recipes;
    for (const int medium : options.media)
    {
      if (medium < 3 && options.has("solve"))
      {
        recipes.push_back(Recipes[medium - 1]);
      }
      else if (medium == 3 && (n <= 256 || options.has("constant")))
      {
        recipes.push_back({ 0., 0. });
      }
    }
    for (const MediumRecipe& recipe : recipes)
    {
      const Problem problem = MakeProblem(n, recipe, parallelFor);
      const double voxels = static_cast<double>(problem.grid.size());
      const int repeat = n > 300 ? std::min(3, options.repeat) : options.repeat;
      std::vector<double> reference;
      if (n <= 128)
      {
        double reached = 0.;
        reference = ReferenceSolution(problem, reached, parallelFor);
      }

      const double tolerance = options.tolerance;
      std::vector<Entry> entries;
      for (const int t : options.threads)
      {
        entries.push_back({ "lighttransport", t,
          [&, t](std::vector<double>& phi, bool)
          { return SolveOursTwice(problem, tolerance, t, phi); },
          {} });
      }
      if (problem.constant)
      {
        entries.push_back({ "lighttransport, iterating", threads,
          [&](std::vector<double>& phi, bool)
          { return SolveOurs(problem, tolerance, threads, phi, true); },
          {} });
      }
      std::unique_ptr<Hypre> hypre;
      if (Hypre::available() && n <= options.largestHypre && !problem.constant)
      {
        hypre.reset(new Hypre(options, problem));
        for (const int t : options.threads)
        {
          entries.push_back({ "hypre PCG+PFMG", t,
            [&, t](std::vector<double>& phi, bool judge)
            { return hypre->solve("pfmg", tolerance, t, judge ? &phi : nullptr); },
            {} });
        }
        if (n == 128 || options.quick)
        {
          entries.push_back({ "hypre PCG+BoomerAMG", threads,
            [&](std::vector<double>& phi, bool judge)
            { return hypre->solve("boomeramg", tolerance, threads, judge ? &phi : nullptr); },
            {} });
        }
      }
#ifdef BENCH_WITH_EIGEN
      if (n <= 96 && !problem.constant)
      {
        entries.push_back({ "Eigen CG+IC", 1,
          [&](std::vector<double>& phi, bool) { return SolveEigen(problem, tolerance, phi); },
          {} });
      }
#endif
#ifdef BENCH_WITH_OPENVDB
      if (problem.constant && n <= 128)
      {
        entries.push_back({ "OpenVDB poisson", threads,
          [&](std::vector<double>& phi, bool)
          { return SolveOpenVDB(problem, tolerance, threads, phi); },
          {} });
      }
#endif
      if (n <= 128 && !problem.constant)
      {
        entries.push_back({ "200 Jacobi sweeps", threads,
          [&](std::vector<double>& phi, bool) { return SolveJacobi(problem, threads, phi); }, {} });
      }

      std::vector<double> phi(problem.q.size());
      for (int i = 0; i < repeat; ++i)
      {
        for (Entry& entry : entries)
        {
          const bool judge = i + 1 == repeat;
          const double cpuBegan = CpuSeconds();
          Run run = entry.solve(phi, judge);
          run.cpu = run.cpu < 0. ? CpuSeconds() - cpuBegan : run.cpu;
          if (judge && run.failure.empty())
          {
            run.residual = Residual(problem, phi.data(), nullptr, parallelFor);
            if (!reference.empty())
            {
              run.errors = FindErrors(phi.data(), reference);
            }
          }
          entry.runs.push_back(run);
        }
      }
      const double resident = n > 256
        ? -1.
        : (8. * voxels + PeakGrowth([&]() { SolveOurs(problem, tolerance, threads, phi); })) /
          voxels;

      for (const Entry& entry : entries)
      {
        const Run& run = entry.runs.back();
        const std::vector<double> s = entry.seconds();
        const double least = *std::min_element(s.begin(), s.end());
        const double most = *std::max_element(s.begin(), s.end());
        const bool ours = entry.solver == "lighttransport";
        kept = kept && !(ours && (!run.failure.empty() || !(run.residual <= 1.1 * tolerance)));
        std::printf("| %d³ | %s | %s | %d | %.3f | %.3f - %.3f | %s | %.3f | %s | %d | %s | %s | "
                    "%s | %s | %s "
                    "| %.0f | %s |%s\n",
          n, problem.name.c_str(), entry.solver.c_str(), entry.threads, median(s), least, most,
          number(entry.again(), "%.3f").c_str(), entry.cpu(), number(run.assemble, "%.3f").c_str(),
          run.iterations, number(run.applications, "%.0f").c_str(),
          number(run.residual, "%.1e").c_str(), number(run.errors.relativeL2, "%.1e").c_str(),
          number(run.errors.p95, "%.1e").c_str(), number(run.bytes / voxels, "%.0f").c_str(),
          1e9 * median(s) / voxels, number(1e9 * entry.again() / voxels, "%.0f").c_str(),
          run.failure.empty() ? "" : (" " + run.failure).c_str());
        csv.add('"' + problem.name + '"', n, entry.solver, entry.threads, median(s), least, most,
          entry.again(), entry.cpu(), run.assemble, run.setup, run.solve, run.iterations,
          run.applications, run.bytes / voxels, ours && entry.threads == threads ? resident : -1.,
          run.residual, run.errors.p95, run.errors.relativeL2, repeat);
      }
      std::fflush(stdout);

      // In each repeat this solver ran right beside the best of hypre's.
      std::vector<double> quotients;
      std::vector<double> againQuotients;
      std::vector<double> cpuQuotients;
      std::vector<double> seconds;
      std::vector<double> again;
      int iterations = 0;
      double applications = 0.;
      double bytes = 0.;
      for (int i = 0; i < repeat; ++i)
      {
        double theirs = 1e300;
        double theirAgain = 1e300;
        double mine = 0.;
        double myAgain = 0.;
        double theirCpu = 1e300;
        double myCpu = 1e300;
        for (const Entry& entry : entries)
        {
          const Run& run = entry.runs[static_cast<std::size_t>(i)];
          if (entry.solver == "hypre PCG+PFMG" && run.failure.empty())
          {
            theirs = std::min(theirs, run.seconds());
            theirAgain = std::min(theirAgain, run.again);
            theirCpu = std::min(theirCpu, run.cpu);
          }
          if (entry.solver == "lighttransport")
          {
            myCpu = std::min(myCpu, run.cpu);
          }
          if (entry.solver == "lighttransport" && entry.threads == threads)
          {
            mine = run.seconds();
            myAgain = run.again;
            iterations = run.iterations;
            applications = run.applications;
            bytes = run.bytes / voxels;
          }
        }
        seconds.push_back(mine);
        again.push_back(myAgain);
        if (theirs < 1e300)
        {
          quotients.push_back(theirs / mine);
          againQuotients.push_back(theirAgain / myAgain);
          cpuQuotients.push_back(theirCpu / myCpu);
        }
      }
      char line[400];
      const double floor = triad > 0. ? FloorApplications * FloorBytes * voxels / triad : -1.;
      std::snprintf(line, sizeof line,
        "| %d³ | %s | %.3f | %s | %.3f | %s | %s | %d | %.0f | %s | %s | %.0f | %s | %.0f | %.0f "
        "|\n",
        n, problem.name.c_str(), median(seconds), number(median(quotients), "%.2f").c_str(),
        median(again), number(median(againQuotients), "%.2f").c_str(),
        number(median(cpuQuotients), "%.2f").c_str(), iterations, applications,
        number(floor, "%.4f").c_str(), number(median(again) / floor, "%.1f").c_str(), bytes,
        number(resident, "%.0f").c_str(), 1e9 * median(seconds) / voxels,
        1e9 * median(again) / voxels);
      summary << line;
    }
  }
  std::printf("\n### Summary: lighttransport on %d threads\n\n"
              "times faster: than hypre's PCG+PFMG on its best number of ranks, median of each "
              "repeat's quotient; in CPU seconds: the least of either's, which others' load "
              "hardly touches. Floor: %.0f fine-grid operator applications (HPGMG) of %.0f "
              "bytes per voxel at the triad's bandwidth.\n\n"
              "| size | medium | s | times faster | again, s | times faster | in CPU s | "
              "iterations | fine applications | floor, s | again, times the floor | "
              "bytes / voxel told | resident | ns / voxel | again |\n"
              "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n%s",
    threads, FloorApplications, FloorBytes, summary.str().c_str());
  std::fflush(stdout);
  return kept;
}

//------------------------------------------------------------------------------
std::vector<std::string> split(const char* text)
{
  std::vector<std::string> parts;
  std::istringstream in(text);
  std::string part;
  while (std::getline(in, part, ','))
  {
    parts.push_back(part);
  }
  return parts;
}

std::vector<int> numbers(const char* text)
{
  std::vector<int> values;
  for (const std::string& part : split(text))
  {
    values.push_back(std::atoi(part.c_str()));
  }
  return values;
}

bool Parse(int argc, char* argv[], Options& options)
{
  const std::string program = argv[0];
  const std::size_t slash = program.rfind('/');
  options.folderOfProgram = slash == std::string::npos ? "" : program.substr(0, slash + 1);
  for (int i = 1; i < argc; ++i)
  {
    const std::string option = argv[i];
    if (option == "--quick")
    {
      options.quick = true;
      options.sizes = { 16, 24, 33 };
      options.stepSizes = { 16, 32 };
      options.floorSizes = { 32 };
      options.errorSize = 24;
      options.repeat = 1;
      options.triadLength = 1 << 20;
      continue;
    }
    if (option == "--large")
    {
      options.sizes.push_back(384);
      options.sizes.push_back(512);
      continue;
    }
    const char* value = i + 1 < argc ? argv[++i] : nullptr;
    if (!value)
    {
      return false;
    }
    if (option == "--media")
    {
      options.media = numbers(value);
    }
    else if (option == "--output")
    {
      options.output = value;
    }
    else if (option == "--sizes")
    {
      options.sizes = numbers(value);
    }
    else if (option == "--threads")
    {
      options.threads = numbers(value);
    }
    else if (option == "--sections")
    {
      options.sections = split(value);
    }
    else if (option == "--repeat")
    {
      options.repeat = std::atoi(value);
    }
    else if (option == "--error-size")
    {
      options.errorSize = std::atoi(value);
    }
    else if (option == "--tolerance")
    {
      options.tolerance = std::atof(value);
    }
    else
    {
      return false;
    }
  }
  const auto tooSmall = [](int least) { return [least](int value) { return value < least; }; };
  return !options.threads.empty() && options.repeat > 0 && options.tolerance > 0. &&
    options.errorSize >= 16 &&
    std::none_of(options.threads.begin(), options.threads.end(), tooSmall(1)) &&
    std::none_of(
      options.media.begin(), options.media.end(), [](int m) { return m < 1 || m > 3; }) &&
    std::none_of(options.sizes.begin(), options.sizes.end(), tooSmall(16));
}
} // namespace

int main(int argc, char* argv[])
{
  Options options;
  if (!Parse(argc, argv, options))
  {
    std::fprintf(stderr,
      "usage: bench-diffusion [--output FOLDER] [--sizes 32,64,96,128,256] [--media 1,2,3]\n"
      "  [--threads 1,2] [--repeat 5] [--tolerance 1e-6] [--sections floor,step,error,solve]\n"
      "  [--error-size 128] [--large] [--quick]        (sizes are 16 at least)\n");
    return 2;
  }
  std::filesystem::create_directories(options.output);
  // What Open MPI asks of a machine where others work too: no pinning, no spinning, and root may.
  setenv("OMPI_MCA_mpi_yield_when_idle", "1", 0);
  setenv("OMPI_MCA_hwloc_base_binding_policy", "none", 0);
  setenv("OMPI_MCA_rmaps_base_oversubscribe", "1", 0);
  setenv("OMPI_MCA_btl_vader_single_copy_mechanism", "none", 0);
  setenv("OMPI_ALLOW_RUN_AS_ROOT", "1", 0);
  setenv("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1", 0);

  std::string cpu = "unknown processor";
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);)
  {
    if (line.compare(0, 10, "model name") == 0)
    {
      cpu = line.substr(line.find(':') + 2);
      break;
    }
  }
  std::printf("# bench-diffusion\n\n%s; medians of %d; load average at the start: %s.\n",
    cpu.c_str(), options.repeat, load().c_str());
  if (!Hypre::available())
  {
    std::printf("Built without hypre: its rows are left out.\n");
  }
#ifndef BENCH_WITH_EIGEN
  std::printf("Built without Eigen: its rows are left out.\n");
#endif
#ifndef BENCH_WITH_OPENVDB
  std::printf("Built without OpenVDB: its rows are left out.\n");
#endif
  std::fflush(stdout);

  const double triad = options.has("floor") ? MeasureFloor(options) : 0.;
  if (options.has("step"))
  {
    MeasureSteps(options);
  }
  if (options.has("error"))
  {
    MeasureErrors(options);
  }
  bool kept = true;
  if (options.has("solve") || options.has("constant"))
  {
    kept = MeasureSolves(options, triad);
  }
  std::printf("\nLoad average at the end: %s.\n", load().c_str());
  if (!kept)
  {
    std::fprintf(stderr, "error: lighttransport missed the tolerance, see the table\n");
  }
  return kept ? 0 : 1;
}
