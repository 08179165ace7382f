// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * The diffusion solver against its floor and its competitors, all in one run and
 * in turn, so that their quotients mean something on a busy machine.
 *
 *   bench-diffusion [--output FOLDER] [--sizes 32,64,96,128,256,384,512] [--media 1,2,3]
 *     [--threads 1,2] [--repeat 5] [--tolerance 1e-6]
 *     [--sections floor,step,region,error,solve] [--error-size 128] [--limit 2400] [--quick]
 *
 * Prints tables of Markdown and leaves the same numbers as CSV in FOLDER:
 *   floor  STREAM's triad; what share of it the explicit step and a Jacobi sweep reach;
 *          touch: what memory fresh from the system costs
 *   step   one explicit step, beside table 4.1 of the source thesis
 *   region what part of the volume is solved for where light stays in a tube, and would be on the
 *          tiles of an OpenVDB tree
 *   error  the true error against time, for the tolerances of this solver and of hypre
 *          (bench-frugal --sections knobs has the filter's other knobs)
 *   solve  the steady solve at growing sizes: this solver, hypre, Eigen, OpenVDB, Jacobi;
 *          media 1 and 2 are issue 3's two columns, 3 is the same everywhere (up to 384^3).
 *          runs: each single run, as it comes; summary: against hypre
 * The solvers take turns within a repeat. Beyond 256^3 on the most threads alone, beyond 384^3 at
 * most 3 repeats; all but this solver and PFMG have as many repeats as fit into half a minute. What
 * would not fit into that, the memory, or --limit seconds from the start on (0: no limit) is not
 * run, and the row says what it would take. --quick is a smoke test: tiny sizes, once. Times are
 * medians of the repeats, quotients are medians of each repeat's own. Exits with 1 if this solver
 * misses the tolerance anywhere, whatever the times are. bench-diffusion.sh builds, runs, draws.
 */
#include "DiffusionCompetitors.h"
#include "DiffusionSweeps.h"

#include "Core/Watched.h"
#include "vtkLightTransportInternal.h"

#include "vtkSMPTools.h"

#include <algorithm>
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
#ifdef BENCH_MPIEXEC
#include <sys/mman.h>
#include <unistd.h>
#endif

using namespace lighttransport;
using namespace lighttransport::benchmark;

namespace
{
struct Options
{
  std::string output; ///< "results" beside the folder of the program
  std::vector<int> sizes{ 32, 64, 96, 128, 256, 384, 512 };
  std::vector<int> media{ 1, 2, 3 };
  std::vector<int> threads{ 1, 2 };
  std::vector<int> stepSizes{ 128, 256, 512 };
  std::vector<int> floorSizes{ 128, 256 };
  std::vector<std::string> sections{ "floor", "step", "region", "error", "solve" };
  int repeat = 5;
  int errorSize = 128;
  double tolerance = 1e-6;
  std::int64_t triadLength = 32 << 20;
  std::size_t touched = std::size_t(800) << 20; ///< bytes, what a solve at 256^3 takes
  double limit = 2400.;                         ///< seconds
  bool quick = false;
  std::string folderOfProgram;
  double began = 0.;

  int most() const { return *std::max_element(this->threads.begin(), this->threads.end()); }
  bool has(const char* section) const
  {
    return std::find(this->sections.begin(), this->sections.end(), section) != this->sections.end();
  }
};

const MediumRecipe Recipes[] = { { 1e4, .99 }, { 1e6, .999 } };

/** To standard error, with the seconds since the start. */
void say(const Options& options, const std::string& what)
{
  std::fprintf(stderr, "%6.0f s  %s\n", now() - options.began, what.c_str());
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

std::string Quoted(const std::string& text)
{
  return '"' + text + '"';
}

/** Three digits. */
std::string Seconds(double value)
{
  return number(value, "%.3g");
}

/**
 * Comma-separated values, each line on disk at once. What is unknown (negative, not a number) is
 * left empty. Texts that may hold a comma: Quoted().
 */
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
    const char* comma = "";
    ((this->file << comma << field(values), comma = ","), ...);
    this->file << std::endl;
  }

private:
  static std::string field(double value) { return number(value, "%.9g"); }
  static std::string field(int value) { return std::to_string(value); }
  static std::string field(std::size_t value) { return std::to_string(value); }
  static std::string field(const std::string& value) { return value; }
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

#ifdef BENCH_MPIEXEC
/** A file in memory that other processes may open by its path, and that goes with this one. */
class MemoryFile
{
public:
  MemoryFile()
    : descriptor(memfd_create("bench-diffusion", 0))
  {
  }
  ~MemoryFile() { close(this->descriptor); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  std::string path() const
  {
    return "/proc/" + std::to_string(getpid()) + "/fd/" + std::to_string(this->descriptor);
  }

private:
  int descriptor;
};
#endif

/** hypre's in a process of its own, since it needs MPI to use two cores. */
class Hypre
{
public:
  Hypre(const Options& o, const Problem& problem)
    : options(o)
  {
#ifdef BENCH_MPIEXEC
    std::ofstream out(this->file.path(), std::ios::binary);
    const std::int32_t header[4] = { problem.grid.dims[0], problem.grid.dims[1],
      problem.grid.dims[2], static_cast<std::int32_t>(problem.boundary) };
    out.write(reinterpret_cast<const char*>(header), sizeof header);
    for (const std::vector<float>* values : { &problem.D, &problem.sigma_a, &problem.q })
    {
      out.write(reinterpret_cast<const char*>(values->data()),
        static_cast<std::streamsize>(values->size() * sizeof(float)));
    }
#else
    (void)problem;
#endif
  }

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
    const MemoryFile solution;
    std::ostringstream command;
    command << BENCH_MPIEXEC << " " << ranks << " '" << this->options.folderOfProgram
            << "bench-diffusion-hypre' " << this->file.path() << " " << kind << " " << tolerance;
    if (phi)
    {
      command << " " << solution.path();
    }
    FILE* pipe = popen(command.str().c_str(), "r");
    char line[256] = "";
    if (!pipe || !std::fgets(line, sizeof line, pipe) ||
      std::sscanf(line, "%lf %lf %lf %d %lf %lf %lf", &run.assemble, &run.setup, &run.solve,
        &run.iterations, &run.bytes, &run.cpu, &run.again) != 7)
    {
      run = Run();
      run.failure = "no answer from bench-diffusion-hypre";
    }
    if (pipe && pclose(pipe) != 0)
    {
      run = Run();
      run.failure = "bench-diffusion-hypre failed";
    }
    if (phi && run.failure.empty())
    {
      std::ifstream in(solution.path(), std::ios::binary);
      in.read(reinterpret_cast<char*>(phi->data()),
        static_cast<std::streamsize>(phi->size() * sizeof(double)));
      if (!in)
      {
        run.failure = "no solution from bench-diffusion-hypre";
      }
    }
#else
    (void)kind, (void)tolerance, (void)ranks, (void)phi;
    run.failure = "built without hypre";
#endif
    return run;
  }

private:
  const Options& options;
#ifdef BENCH_MPIEXEC
  MemoryFile file;
#endif
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
/**
 * Seconds of one explicit step: those of many less those of two, so that a call's other passes
 * cancel. Only in a heap that keeps its memory, or fresh memory counts in one and not the other.
 */
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
  const KeepHeap keep;
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
      const Problem problem = MakeProblem(n, MakeVolume(n, parallelFor), Recipes[0], parallelFor);
      DiffusionSolver solver(parallelFor);
      solver.setMedium(problem.medium());
      Jacobi jacobi(problem, parallelFor);
      jacobi.sweep(parallelFor);
      std::vector<double> phi(problem.q.size(), 0.);
      const int more = n >= 200 ? 4 : 20;
      StepSeconds(solver, problem, phi, more); // touches the memory
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

/** What memory costs that the system has to find first. */
void MeasureTouch(const Options& options)
{
  Table csv(options, "touch", "pages,threads,repeat,bytes,seconds,seconds_again");
  const int threads = options.most();
  const ParallelFor parallelFor = OnThreads(threads);
  std::printf("\n### Fresh memory\n\n"
              "Writing to %.0f MB that the system has just lent, given back, and lent again, and "
              "writing to them once more, on %d threads: about what a solve at 256³ takes. The "
              "first write is part of its \"s\" below, not of its \"again\". A virtual machine "
              "whose host takes free memory back may need a second for it.\n\n"
              "| pages | first write, s: each repeat | second write, s: median |\n|---|---|---|\n",
    1e-6 * static_cast<double>(options.touched), threads);
  const std::pair<TouchedPages, const char*> kinds[] = { { TouchedPages::Small, "small (4 KiB)" },
    { TouchedPages::Large, "large, as the solver asks for" },
    { TouchedPages::Populated, "large, all at once (MADV_POPULATE_WRITE)" } };
  std::vector<std::string> first(std::size(kinds));
  std::vector<std::vector<double>> second(std::size(kinds));
  for (int i = 0; i < options.repeat; ++i)
  {
    for (std::size_t k = 0; k < std::size(kinds); ++k)
    {
      const auto [seconds, again] = TouchSeconds(options.touched, kinds[k].first, parallelFor);
      first[k] += (i ? ", " : "") + (seconds < 0. ? "not here" : number(seconds, "%.3f"));
      second[k].push_back(again);
      csv.add(Quoted(kinds[k].second), threads, i, options.touched, seconds, again);
    }
  }
  for (std::size_t k = 0; k < std::size(kinds); ++k)
  {
    std::printf("| %s | %s | %s |\n", kinds[k].second, first[k].c_str(),
      number(median(second[k]), "%.3f").c_str());
  }
  std::fflush(stdout);
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
  const KeepHeap keep;
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
/** Light in a bent tube of clear matter, in dark matter: n^3 voxels. */
Problem MakeTube(int n)
{
  Problem problem;
  problem.name = "tube";
  problem.grid.dims = { { n, n, n } };
  const std::size_t count = static_cast<std::size_t>(problem.grid.size());
  problem.D.assign(count, 1e-4f);
  problem.sigma_a.assign(count, 1.f);
  problem.q.assign(count, 0.f);
  const auto axis = [](double x, double& y, double& z)
  {
    y = .5 + .2 * std::sin(6. * x);
    z = .5 + .2 * std::cos(6. * x);
  };
  const double radius = 4. / n;
  std::size_t at = 0;
  for (int k = 0; k < n; ++k)
  {
    for (int j = 0; j < n; ++j)
    {
      for (int i = 0; i < n; ++i, ++at)
      {
        double y, z;
        axis(1. * i / n, y, z);
        if (std::hypot(1. * j / n - y, 1. * k / n - z) < radius)
        {
          problem.D[at] = 1.f;
          problem.sigma_a[at] = 1e-3f;
        }
      }
    }
  }
  double y, z;
  axis(.4, y, z);
  problem.seed =
    problem.grid.index(static_cast<int>(.4 * n), static_cast<int>(y * n), static_cast<int>(z * n));
  problem.q[static_cast<std::size_t>(problem.seed)] = 1.f;
  return problem;
}

void MeasureRegion(const Options& options)
{
  const int n = options.quick ? 32 : 128;
  const int threads = options.most();
  const ParallelFor parallelFor = OnThreads(threads);
  const Problem problem = MakeTube(n);
  const std::size_t count = problem.q.size();
  std::vector<double> phi(count, 0.);
  DiffusionControl control;
  control.tolerance = options.tolerance;
  std::vector<double> seconds;
  double part = 0.;
  for (int i = 0; i < options.repeat; ++i)
  {
    const double began = now();
    DiffusionSolver solver(parallelFor);
    const DiffusionReport report =
      solver.solveActive(problem.medium(), problem.q.data(), phi.data(), control);
    seconds.push_back(now() - began);
    part = report.activeFraction;
  }
  const double most = *std::max_element(phi.begin(), phi.end());
  std::vector<std::uint8_t> lit(count);
  std::transform(phi.begin(), phi.end(), lit.begin(),
    [most](double value) { return static_cast<std::uint8_t>(value > 1e-7 * most); });
  const double voxels = static_cast<double>(count);
  const double litPart = static_cast<double>(std::count(lit.begin(), lit.end(), 1)) / voxels;

  Table csv(options, "region", "what,size,threads,percent_of_volume,seconds");
  std::printf("\n## Where light stays in a tube, %d³\n\n"
              "Per cent of the volume's voxels: those with more than 1e-7 of the largest phi; the "
              "rows of the active region, and the time to find it and solve on it, medium to phi; "
              "the tiles of 8³ of an OpenVDB tree that has those same voxels, and the time to grow "
              "its topology from the source into them, a voxel at a time, with no solve.\n\n"
              "| what | %% of the volume | s |\n|---|---|---|\n",
    n);
  const auto line = [&](const char* what, double share, double s)
  {
    std::printf("| %s | %.2f | %s |\n", what, 100. * share, number(s, "%.4f").c_str());
    csv.add(Quoted(what), n, threads, 100. * share, s);
  };
  line("lit voxels", litPart, -1.);
  line("active region: rows, and all of the solve", part, median(seconds));
#ifdef BENCH_WITH_OPENVDB
  std::vector<double> growing;
  double tiles = 0.;
  for (int i = 0; i < options.repeat; ++i)
  {
    double s = 0.;
    tiles = GrowOpenVDB(problem, lit, s) / voxels;
    growing.push_back(s);
  }
  line("OpenVDB: tiles, and growing alone", tiles, median(growing));
#endif
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
  const std::vector<float> S = MakeVolume(n, parallelFor);
  for (const MediumRecipe& recipe : Recipes)
  {
    const Problem problem = MakeProblem(n, S, recipe, parallelFor);
    const Hypre hypre(options, problem);
    double reached = 0.;
    const std::vector<double> reference = ReferenceSolution(problem, reached, parallelFor);
    if (!(reached <= 1e-12))
    {
      std::printf(
        "| %s | reference | reached only %.1e | | | | | | | |\n", problem.name.c_str(), reached);
    }
    std::vector<Knob> knobs;
    knobs.push_back(
      { "tolerance of lighttransport", { 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10 },
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
        say(options,
          "error, " + problem.name + ": " + knob.name + ", repeat " + std::to_string(i + 1));
        for (std::size_t v = 0; v < knob.values.size(); ++v)
        {
          std::fill(phi.begin(), phi.end(), 0.);
          const double cpuBegan = CpuSeconds();
          last[v] = knob.solve(problem, knob.values[v], phi);
          if (!last[v].failure.empty())
          {
            continue;
          }
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
        if (seconds[v].empty())
        {
          std::printf("| %s | %s | %.0e | failed: %s | | | | | | |\n", problem.name.c_str(),
            knob.name.c_str(), knob.values[v], run.failure.c_str());
          continue;
        }
        const double s = median(seconds[v]);
        const double bytes = run.bytes / static_cast<double>(problem.grid.size());
        std::printf("| %s | %s | %.0e | %s | %s | %d | %.1e | %.1e | %.1e | %.0f %s|\n",
          problem.name.c_str(), knob.name.c_str(), knob.values[v], Seconds(s).c_str(),
          Seconds(median(cpu[v])).c_str(), run.iterations, run.residual, run.errors.p95,
          run.errors.relativeL2, bytes, run.failure.empty() ? "" : (run.failure + " ").c_str());
        csv.add(Quoted(problem.name), Quoted(knob.name), knob.values[v], n, threads, s,
          median(cpu[v]), run.iterations, run.residual, run.errors.p95, run.errors.relativeL2,
          bytes);
      }
      std::fflush(stdout);
    }
  }
}

//------------------------------------------------------------------------------
/** A solver on so many threads, and what it did at one size. */
struct Entry
{
  std::string solver;
  int threads;
  /** Seconds at 128^3, as long as no smaller size has told. */
  double guess;
  /** By which power of the size the time grows: 4 where iterations do too. */
  double power;
  /** phi holds the solution if the run says so by a true `judge`. */
  std::function<Run(std::vector<double>& phi, bool judge)> solve;
  int repeat = 1;
  std::string left; ///< why there is no run, or fewer than wanted
  std::vector<Run> runs;

  /** Of the runs that came to an end. */
  std::vector<double> all(const std::function<double(const Run&)>& value) const
  {
    std::vector<double> values;
    for (const Run& run : this->runs)
    {
      if (run.failure.empty())
      {
        values.push_back(value(run));
      }
    }
    return values;
  }
  std::vector<double> seconds() const
  {
    return this->all([](const Run& run) { return run.seconds(); });
  }
  double again() const
  {
    return median(this->all([](const Run& run) { return run.again; }));
  }
  double cpu() const
  {
    return median(this->all([](const Run& run) { return run.cpu; }));
  }
};

/** What a run took at a smaller size, to tell what it will take at the next. */
struct Cost
{
  int size = 0;
  double seconds = 0.; ///< all of it, with what does not count as the solver's time
  double bytes = 0.;   ///< per voxel
};

/** HPGMG's count for a full multigrid solve, and the bytes of an application in float. */
constexpr double FloorApplications = 13.;
constexpr double FloorBytes = 24.; // 3 faces, sink, x in, y out

/** For solvers that are here for comparison alone. */
constexpr double Patience = 30.; // seconds

const char* const Ours = "lighttransport";
const char* const Theirs = "hypre PCG+PFMG";

/** Rows of the closing tables. */
struct Summary
{
  std::ostringstream beside, cost;
};

/** This solver on so many threads against hypre's PFMG on at most so many ranks. */
void Summarise(const Problem& problem, const std::vector<Entry>& entries, int threads, double triad,
  double resident, Table& csv, Summary& summary)
{
  const auto mine = std::find_if(entries.begin(), entries.end(),
    [threads](const Entry& e) { return e.solver == Ours && e.threads == threads; });
  if (mine == entries.end() || mine->seconds().empty())
  {
    return;
  }
  // In each repeat this solver ran right beside hypre's.
  std::vector<double> quotients;
  std::vector<double> againQuotients;
  std::vector<double> cpuQuotients;
  for (std::size_t i = 0; i < mine->runs.size(); ++i)
  {
    double theirs = 1e300;
    double theirAgain = 1e300;
    double theirCpu = 1e300;
    double myCpu = 1e300;
    for (const Entry& entry : entries)
    {
      if (entry.threads > threads || i >= entry.runs.size() || !entry.runs[i].failure.empty())
      {
        continue;
      }
      const Run& run = entry.runs[i];
      if (entry.solver == Theirs)
      {
        theirs = std::min(theirs, run.seconds());
        theirAgain = std::min(theirAgain, run.again);
        theirCpu = std::min(theirCpu, run.cpu);
      }
      if (entry.solver == Ours)
      {
        myCpu = std::min(myCpu, run.cpu);
      }
    }
    const Run& run = mine->runs[i];
    if (theirs < 1e300 && run.failure.empty())
    {
      quotients.push_back(theirs / run.seconds());
      againQuotients.push_back(theirAgain / run.again);
      cpuQuotients.push_back(theirCpu / myCpu);
    }
  }
  // hypre's columns: on the number of ranks that took it least
  const Entry* best = nullptr;
  std::string remark;
  for (const Entry& entry : entries)
  {
    if (entry.solver == Theirs && entry.threads <= threads)
    {
      remark = entry.left;
      best =
        !entry.seconds().empty() && (!best || median(entry.seconds()) < median(best->seconds()))
        ? &entry
        : best;
    }
  }
  const Run none;
  const Run& hypre = best ? best->runs.front() : none;
  const double theirs = best ? median(best->seconds()) : -1.;
  const double theirAgain = best ? best->again() : -1.;
  const int n = problem.grid.dims[0];
  const double voxels = static_cast<double>(problem.grid.size());
  const double s = median(mine->seconds());
  const double again = mine->again();
  const double floor = triad > 0. ? FloorApplications * FloorBytes * voxels / triad : -1.;
  const Run& run = mine->runs.front();
  std::ostringstream head;
  head << "| " << n << "³ | " << problem.name << " | " << threads << " | ";
  summary.beside << head.str() << mine->runs.size() << " | " << Seconds(s) << " | "
                 << (best ? Seconds(theirs) : remark) << " | " << number(median(quotients), "%.2f")
                 << " | " << Seconds(again) << " | " << Seconds(theirAgain) << " | "
                 << number(median(againQuotients), "%.2f") << " | "
                 << number(median(cpuQuotients), "%.2f") << " |\n";
  summary.cost << head.str() << run.iterations << " | " << number(hypre.iterations, "%.0f") << " | "
               << number(run.applications, "%.0f") << " | " << number(run.bytes / voxels, "%.0f")
               << " | " << number(resident, "%.0f") << " | " << number(hypre.bytes / voxels, "%.0f")
               << " | " << number(1e9 * s / voxels, "%.0f") << " | "
               << number(1e9 * again / voxels, "%.0f") << " | " << Seconds(floor) << " | "
               << (floor > 0. ? number(again / floor, "%.1f") : "") << " |\n";
  csv.add(n, Quoted(problem.name), threads, mine->runs.size(), s, theirs, median(quotients), again,
    theirAgain, median(againQuotients), median(cpuQuotients), run.iterations, hypre.iterations,
    run.applications, run.bytes / voxels, resident, hypre.bytes / voxels, floor);
}

/** The solvers of a problem; hypre is filled in later, if any of its entries is to run. */
std::vector<Entry> MakeEntries(
  const Options& options, const Problem& problem, const std::unique_ptr<Hypre>& hypre)
{
  const double tolerance = options.tolerance;
  const int most = options.most();
  const int n = problem.grid.dims[0];
  std::vector<Entry> entries;
  const auto add = [&entries](const char* solver, int threads, double guess, double power,
                     std::function<Run(std::vector<double>&, bool)> solve) {
    entries.push_back({ solver, threads, guess, power, std::move(solve), 1, "", {} });
  };
  for (const int t : options.threads)
  {
    if (n > 256 && t < most)
    {
      continue;
    }
    add(Ours, t, .5, 3.,
      [&problem, tolerance, t](std::vector<double>& phi, bool)
      { return SolveOursTwice(problem, tolerance, t, phi); });
    if (Hypre::available() && !problem.constant)
    {
      add(Theirs, t, 2., 3.,
        [&hypre, tolerance, t](std::vector<double>& phi, bool judge)
        { return hypre->solve("pfmg", tolerance, t, judge ? &phi : nullptr); });
    }
  }
  if (Hypre::available() && !problem.constant)
  {
    add("hypre PCG+BoomerAMG", most, 3., 3.,
      [&hypre, tolerance, most](std::vector<double>& phi, bool judge)
      { return hypre->solve("boomeramg", tolerance, most, judge ? &phi : nullptr); });
  }
  if (problem.constant)
  {
    add("lighttransport, iterating", most, .3, 3.,
      [&problem, tolerance, most](std::vector<double>& phi, bool)
      { return SolveOurs(problem, tolerance, most, phi, true); });
  }
#ifdef BENCH_WITH_EIGEN
  if (!problem.constant)
  {
    add("Eigen CG+IC", 1, 5., 4.,
      [&problem, tolerance](std::vector<double>& phi, bool)
      { return SolveEigen(problem, tolerance, phi); });
  }
#endif
#ifdef BENCH_WITH_OPENVDB
  if (problem.constant)
  {
    add("OpenVDB poisson", most, 3., 4.,
      [&problem, tolerance, most](std::vector<double>& phi, bool)
      { return SolveOpenVDB(problem, tolerance, most, phi); });
  }
#endif
  if (n <= 128 && !problem.constant) // what it shows is its error
  {
    add("200 Jacobi sweeps", most, .3, 3.,
      [&problem, most](std::vector<double>& phi, bool) { return SolveJacobi(problem, most, phi); });
  }
  return entries;
}

/** False if this solver has not kept its promise somewhere. */
bool MeasureSolves(const Options& options, double triad)
{
  Table csv(options, "solve",
    "medium,size,solver,threads,seconds,seconds_min,seconds_max,again,cpu_seconds,assemble,setup,"
    "solve,iterations,applications,bytes_per_voxel,resident_per_voxel,residual,p95,relative_l2,"
    "repeats,remark");
  Table runsCsv(options, "runs",
    "medium,size,solver,threads,repeat,setup,solve,again,cpu_seconds,assemble,iterations,failure");
  Table summaryCsv(options, "summary",
    "size,medium,threads,repeats,seconds,hypre_seconds,times_faster,again,hypre_again,"
    "again_times_faster,cpu_times_faster,iterations,hypre_iterations,applications,bytes_per_voxel,"
    "resident_per_voxel,hypre_bytes_per_voxel,floor");
  std::printf(
    "\n## The steady solve, relative residual %.0e\n\n"
    "s: set-up + solve (hypre's and Eigen's filling of the matrix, OpenVDB's of the tree are not "
    "in it; D to phi for this solver), in memory that is fresh from the system; again: the same in "
    "a heap that a solve before it has left; medians of so many repeats. Before each solve, "
    "whoever's, 200 bytes per voxel are written to and given back, so that a virtual machine has "
    "them from its host: see below for what that took. Residual: "
    "|q - A phi| / |q| in double by the same function for all (OpenVDB stops by the maximum norm, "
    "the others by this one). Bytes beyond the input, phi included: as the solver tells (hypre: "
    "resident). Errors as above. Not run: what would take more than %.0f s or --limit, or more "
    "memory than there is, told from the size before: times grow by the third power of the size, "
    "where iterations grow too (Eigen, OpenVDB) by the fourth.\n\n"
    "| size | medium | solver | threads | repeats | s | min - max | again, s | CPU s | assembly | "
    "iterations | fine applications | residual | L2 | p95 | bytes / voxel | ns / voxel | again |\n"
    "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    options.tolerance, Patience);
  Summary summary;
  std::map<std::string, Cost> costs;
  std::map<int, std::vector<double>> lent; // by size: seconds per GB until the machine has it
  bool kept = true;
  const int threads = options.most();
  const ParallelFor parallelFor = OnThreads(threads);
  for (const int n : options.sizes)
  {
    if (options.limit > 0. && now() - options.began > options.limit)
    {
      std::printf("| %d³ | | | | 0 | not run: --limit was reached | | | | | | | | | | | | |\n", n);
      continue;
    }
    say(options, std::to_string(n) + "³: making the volume");
    const std::vector<float> S = MakeVolume(n, parallelFor);
    for (const int medium : options.media)
    {
      if (medium == 3 && n > 384)
      {
        continue;
      }
      const MediumRecipe recipe = medium == 3 ? MediumRecipe{ 0., 0. } : Recipes[medium - 1];
      const Problem problem = MakeProblem(n, S, recipe, parallelFor);
      const double voxels = static_cast<double>(problem.grid.size());
      const std::string title = std::to_string(n) + "³, " + problem.name;
      std::vector<double> reference;
      if (n <= 128)
      {
        double reached = 0.;
        reference = ReferenceSolution(problem, reached, parallelFor);
      }
      std::vector<double> phi(problem.q.size());

      std::unique_ptr<Hypre> hypre;
      std::vector<Entry> entries = MakeEntries(options, problem, hypre);
      const double available = 1024. * fromProc("/proc/meminfo", "MemAvailable");
      int repeat = 0;
      bool needsHypre = false;
      const auto costOf = [&](const Entry& entry) -> Cost&
      { return costs[entry.solver + std::to_string(entry.threads) + problem.name]; };
      const auto expected = [&](const Entry& entry)
      {
        const Cost& cost = costOf(entry);
        return cost.size ? cost.seconds * std::pow(1. * n / cost.size, entry.power)
                         : entry.guess * std::pow(n / 128., entry.power);
      };
      for (Entry& entry : entries)
      {
        const bool main = entry.solver == Ours || entry.solver == Theirs;
        const double seconds = expected(entry);
        // and the answer twice, where another process gives it
        const double bytes = costOf(entry).size ? (costOf(entry).bytes + 16.) * voxels : 0.;
        const int wanted = n <= 384 ? options.repeat : std::min(3, options.repeat);
        entry.repeat =
          main ? wanted : std::min(wanted, static_cast<int>(Patience / std::max(1e-3, seconds)));
        char text[100] = "";
        if (available > 0. && bytes > 0.95 * available)
        {
          std::snprintf(text, sizeof text, "not run: would take %.0f GB of memory", 1e-9 * bytes);
        }
        else if (entry.repeat == 0)
        {
          std::snprintf(text, sizeof text, "not run: would take about %.0f s", seconds);
        }
        entry.left = text;
        entry.repeat = *text ? 0 : entry.repeat;
        repeat = std::max(repeat, entry.repeat);
        needsHypre = needsHypre || (entry.repeat && entry.solver.compare(0, 5, "hypre") == 0);
      }
      if (needsHypre)
      {
        hypre.reset(new Hypre(options, problem));
      }

      for (int i = 0; i < repeat; ++i)
      {
        for (Entry& entry : entries)
        {
          if (i >= entry.repeat)
          {
            continue;
          }
          if (options.limit > 0. && now() - options.began + expected(entry) > options.limit)
          {
            char text[100];
            std::snprintf(text, sizeof text,
              i ? "then --limit was reached" : "not run: would take about %.0f s, beyond --limit",
              expected(entry));
            entry.left = text;
            entry.repeat = i;
            continue;
          }
          const std::size_t touched = static_cast<std::size_t>(
            std::min(200. * voxels, available > 0. ? 0.5 * available : 0.));
          lent[n].push_back(
            1e9 * TouchSeconds(touched, TouchedPages::Large, parallelFor).first / touched);
          const double cpuBegan = CpuSeconds();
          const double began = now();
          Run run = entry.solve(phi, i == 0);
          const double wall = now() - began;
          run.cpu = run.cpu < 0. ? CpuSeconds() - cpuBegan : run.cpu;
          if (run.failure.empty() && i == 0)
          {
            run.residual = Residual(problem, phi.data(), nullptr, parallelFor);
            if (!reference.empty())
            {
              run.errors = FindErrors(phi.data(), reference);
            }
          }
          if (run.failure.empty())
          {
            costOf(entry) = { n, wall, std::max(0., run.bytes) / voxels };
          }
          if (entry.solver != Ours && entry.solver != Theirs)
          {
            entry.repeat = std::min(entry.repeat, std::max(1, static_cast<int>(Patience / wall)));
          }
          say(options,
            title + ", " + std::to_string(i + 1) + " of " + std::to_string(entry.repeat) + ": " +
              entry.solver + " on " + std::to_string(entry.threads) + ": " +
              (run.failure.empty() ? Seconds(run.seconds()) + " s" : "failed: " + run.failure));
          runsCsv.add(Quoted(problem.name), n, Quoted(entry.solver), entry.threads, i, run.setup,
            run.solve, run.again, run.cpu, run.assemble, run.iterations, Quoted(run.failure));
          entry.runs.push_back(run);
        }
      }
      const double resident = n > 256
        ? -1.
        : (8. * voxels +
            PeakGrowth([&]() { SolveOurs(problem, options.tolerance, threads, phi); })) /
          voxels;

      for (const Entry& entry : entries)
      {
        const std::vector<double> s = entry.seconds();
        std::string remark = entry.left;
        if (s.size() < entry.runs.size())
        {
          const auto failed = std::find_if(entry.runs.begin(), entry.runs.end(),
            [](const Run& run) { return !run.failure.empty(); });
          remark = std::to_string(entry.runs.size() - s.size()) + " of " +
            std::to_string(entry.runs.size()) + " failed: " + failed->failure;
        }
        kept = kept && !(entry.solver == Ours && s.size() < entry.runs.size());
        if (s.empty())
        {
          std::printf("| %d³ | %s | %s | %d | 0 | %s | | | | | | | | | | | | |\n", n,
            problem.name.c_str(), entry.solver.c_str(), entry.threads, remark.c_str());
          csv.add(Quoted(problem.name), n, Quoted(entry.solver), entry.threads,
            std::string(15, ',') + "0", Quoted(remark));
          continue;
        }
        const Run& run = entry.runs.front(); // the one that was judged
        const double least = *std::min_element(s.begin(), s.end());
        const double most = *std::max_element(s.begin(), s.end());
        const bool ours = entry.solver == Ours;
        kept = kept && !(ours && !(run.residual <= 1.1 * options.tolerance));
        std::printf("| %d³ | %s | %s | %d | %zu | %s | %s - %s | %s | %s | %s | %d | %s | %s | "
                    "%s | %s | %s | %.0f | %s |%s\n",
          n, problem.name.c_str(), entry.solver.c_str(), entry.threads, s.size(),
          Seconds(median(s)).c_str(), Seconds(least).c_str(), Seconds(most).c_str(),
          Seconds(entry.again()).c_str(), Seconds(entry.cpu()).c_str(),
          Seconds(run.assemble).c_str(), run.iterations, number(run.applications, "%.0f").c_str(),
          number(run.residual, "%.1e").c_str(), number(run.errors.relativeL2, "%.1e").c_str(),
          number(run.errors.p95, "%.1e").c_str(), number(run.bytes / voxels, "%.0f").c_str(),
          1e9 * median(s) / voxels, number(1e9 * entry.again() / voxels, "%.0f").c_str(),
          remark.empty() ? "" : (" " + remark).c_str());
        csv.add(Quoted(problem.name), n, Quoted(entry.solver), entry.threads, median(s), least,
          most, entry.again(), entry.cpu(), run.assemble, run.setup, run.solve, run.iterations,
          run.applications, run.bytes / voxels, ours && entry.threads == threads ? resident : -1.,
          run.residual, run.errors.p95, run.errors.relativeL2, s.size(), Quoted(remark));
      }
      std::fflush(stdout);
      for (const int t : options.threads)
      {
        Summarise(problem, entries, t, t == threads ? triad : 0., t == threads ? resident : -1.,
          summaryCsv, summary);
      }
    }
  }
  std::printf(
    "\nSeconds that the machine took to have a GB ready, before a solve: median, most.\n\n"
    "| size | median | most |\n|---|---|---|\n");
  for (const auto& one : lent)
  {
    std::printf("| %d³ | %.3f | %.3f |\n", one.first, median(one.second),
      *std::max_element(one.second.begin(), one.second.end()));
  }
  std::printf("\n### lighttransport beside hypre's PCG+PFMG\n\n"
              "hypre on its best number of ranks up to these threads; times faster: the median of "
              "each repeat's quotient; in CPU seconds: the least of either's, which others' load "
              "hardly touches.\n\n"
              "| size | medium | threads | repeats | s | hypre | times faster | again, s | hypre | "
              "times faster | in CPU s |\n|---|---|---|---|---|---|---|---|---|---|---|\n%s\n"
              "Bytes: per voxel beyond the input, as told, and resident. Floor: %.0f fine-grid "
              "operator applications (HPGMG) of %.0f bytes per voxel at the triad's bandwidth.\n\n"
              "| size | medium | threads | iterations | hypre | fine applications | bytes | "
              "resident | hypre | ns / voxel | again | floor, s | again, times the floor |\n"
              "|---|---|---|---|---|---|---|---|---|---|---|---|---|\n%s",
    summary.beside.str().c_str(), FloorApplications, FloorBytes, summary.cost.str().c_str());
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
  options.output = options.folderOfProgram + "../results";
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
      options.touched = std::size_t(8) << 20;
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
    else if (option == "--limit")
    {
      options.limit = std::atof(value);
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
  options.began = now();
  if (!Parse(argc, argv, options))
  {
    std::fprintf(stderr,
      "usage: bench-diffusion [--output FOLDER] [--sizes 32,64,96,128,256,384,512]\n"
      "  [--media 1,2,3] [--threads 1,2] [--repeat 5] [--tolerance 1e-6]\n"
      "  [--sections floor,step,region,error,solve] [--error-size 128] [--limit 2400] [--quick]\n"
      "  (sizes are 16 at least; --limit in seconds, 0: none)\n");
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
  std::printf("# bench-diffusion\n\n%s; medians of %d where nothing else is said; load average at "
              "the start: %s.\n",
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

  double triad = 0.;
  if (options.has("floor"))
  {
    say(options, "floor");
    triad = MeasureFloor(options);
    MeasureTouch(options);
  }
  if (options.has("step"))
  {
    say(options, "step");
    MeasureSteps(options);
  }
  if (options.has("region"))
  {
    MeasureRegion(options);
  }
  if (options.has("error"))
  {
    MeasureErrors(options);
  }
  const bool kept = !options.has("solve") || MeasureSolves(options, triad);
  std::printf(
    "\nAfter %.0f s; load average at the end: %s.\n", now() - options.began, load().c_str());
  if (!kept)
  {
    std::fprintf(stderr, "error: lighttransport missed the tolerance, see the table\n");
  }
  return kept ? 0 : 1;
}
