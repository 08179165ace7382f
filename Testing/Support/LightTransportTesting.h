// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * What every test needs and no VTK: checks that collect failures, so that all
 * sub-cases run and then fail together, and the command line.
 *
 *   int main(int argc, char* argv[])
 *   {
 *     lighttransport::testing::Suite suite(argc, argv);
 *     LT_CHECK(suite, 1 + 1 == 2);
 *     LT_CHECK_NEAR(suite, std::sqrt(2.), 1.4142, 1e-4);
 *     return suite.result();
 *   }
 */
#ifndef LightTransportTesting_h
#define LightTransportTesting_h

#include <cfenv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <string>

namespace lighttransport
{
namespace testing
{
/**
 * Whether this is a build that looks for races, which takes twenty times as long: what runs in
 * one thread, and is the same in the other builds, may then be left out.
 */
#if defined(__SANITIZE_THREAD__)
constexpr bool LookingForRaces = true;
#else
constexpr bool LookingForRaces = false;
#endif

/** Where a program leaves files that is not told where: in its build, never where it is called. */
inline std::string temporaryFolder(const std::string& program)
{
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::path folder =
    fs::absolute(program, error).parent_path().parent_path() / "Testing" / "Temporary";
  return (fs::is_directory(folder, error) ? folder : fs::temp_directory_path(error)).string();
}

class Suite
{
public:
  Suite(int argc, char* argv[])
    : temporary(temporaryFolder(argc > 0 ? argv[0] : ""))
  {
    for (int i = 1; i + 1 < argc; ++i)
    {
      const std::string option = argv[i];
      if (option == "-T")
      {
        this->temporary = argv[++i];
      }
      else if (option == "-B")
      {
        this->baselines = argv[++i];
      }
      else if (option == "-D")
      {
        this->data = argv[++i];
      }
    }
  }

  std::string temporary;
  std::string baselines = ".";
  std::string data;

  /** Numerics run with floating-point exceptions on: a NaN traps where it is born. */
  static void trapFloatingPoint()
  {
#if defined(__GLIBC__)
    feenableexcept(FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW);
#endif
  }

  /** Where it is VTK itself that computes with what is bad on purpose. */
  class WithoutTraps
  {
  public:
#if defined(__GLIBC__)
    WithoutTraps()
      : before(fedisableexcept(FE_ALL_EXCEPT))
    {
    }
    ~WithoutTraps()
    {
      feclearexcept(FE_ALL_EXCEPT);
      feenableexcept(this->before);
    }
#else
    WithoutTraps() = default;
    ~WithoutTraps() {}
#endif
    WithoutTraps(const WithoutTraps&) = delete;
    WithoutTraps& operator=(const WithoutTraps&) = delete;

  private:
#if defined(__GLIBC__)
    int before;
#endif
  };

  /** True where the optional file of the shared data exists; else say so. */
  bool hasData(const std::string& name) const
  {
    if (!this->data.empty() && std::ifstream(this->data + "/" + name).good())
    {
      return true;
    }
    std::cout << "no " << name << " here: skipped\n";
    return false;
  }

  void check(bool ok, const std::string& what, const char* file, int line)
  {
    ++this->checks;
    if (!ok)
    {
      ++this->failures;
      std::cout << file << ":" << line << ": failed: " << what << "\n";
    }
  }

  int result() const
  {
    std::cout << this->checks << " checks, " << this->failures << " failures\n";
    return this->failures == 0 && this->checks > 0 ? 0 : 1;
  }
  static int skipped()
  {
    return 125;
  }

private:
  int checks = 0;
  int failures = 0;
};
} // namespace testing
} // namespace lighttransport

#define LT_CHECK(suite, condition) (suite).check((condition), #condition, __FILE__, __LINE__)

/** |value - expected| <= tolerance; a NaN fails. */
#define LT_CHECK_NEAR(suite, value, expected, tolerance)                                           \
  (suite).check(std::abs((value) - (expected)) <= (tolerance),                                     \
    std::string(#value " = ") + std::to_string(value) + ", expected " + std::to_string(expected) + \
      " +- " + std::to_string(tolerance),                                                          \
    __FILE__, __LINE__)

/** |value - expected| <= tolerance * |expected|; a NaN fails. */
#define LT_CHECK_CLOSE(suite, value, expected, tolerance)                                          \
  LT_CHECK_NEAR(suite, value, expected, (tolerance)*std::abs(expected))

#endif
