// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Progress.h"

#include <algorithm>
#include <cstdio>

#include <unistd.h>

namespace lightvolume
{
namespace
{
double Seconds(std::chrono::steady_clock::duration duration)
{
  return std::chrono::duration<double>(duration).count();
}
} // namespace

class Progress::Observer : public vtkCommand
{
public:
  static Observer* New() { return new Observer; }
  void Execute(vtkObject*, unsigned long, void* data) override
  {
    if (data && this->Owner)
    {
      this->Owner->Show(*static_cast<double*>(data));
    }
  }
  Progress* Owner = nullptr;
};

Progress::Progress(bool quiet)
  : Quiet(quiet)
  , Terminal(isatty(STDOUT_FILENO) != 0)
  , Listener(vtkSmartPointer<Observer>::New())
{
  this->Listener->Owner = this;
}

Progress::~Progress()
{
  this->Listener->Owner = nullptr;
  this->Erase();
}

void Progress::Begin(const std::string& stage, vtkAlgorithm* filter)
{
  this->Stage = stage;
  this->Started = this->LastShown = Clock::now();
  this->Filter = filter;
  if (filter)
  {
    this->Tag = filter->AddObserver(vtkCommand::ProgressEvent, this->Listener);
  }
}

void Progress::Show(double fraction)
{
  const Clock::time_point now = Clock::now();
  const double since = Seconds(now - this->LastShown);
  if (this->Quiet || Seconds(now - this->Started) < 1. || since < (this->Terminal ? .1 : 5.))
  {
    return;
  }
  this->LastShown = now;
  fraction = std::clamp(fraction, 0., 1.);
  constexpr int width = 30;
  const int full = static_cast<int>(fraction * width + .5);
  if (this->Terminal)
  {
    std::printf("\r  %-10s [%s%s] %3.0f %%", this->Stage.c_str(), std::string(full, '#').c_str(),
      std::string(width - full, '.').c_str(), 100. * fraction);
    this->Drawn = true;
  }
  else
  {
    std::printf("  %-10s %3.0f %%\n", this->Stage.c_str(), 100. * fraction);
  }
  std::fflush(stdout);
}

double Progress::End()
{
  const double seconds = Seconds(Clock::now() - this->Started);
  if (this->Filter)
  {
    this->Filter->RemoveObserver(this->Tag);
    this->Filter = nullptr;
  }
  this->Erase();
  this->Times.emplace_back(this->Stage, seconds);
  return seconds;
}

void Progress::Say(const std::string& line)
{
  this->Erase();
  if (!this->Quiet)
  {
    std::printf("%s\n", line.c_str());
    std::fflush(stdout);
  }
}

void Progress::Erase()
{
  if (this->Drawn)
  {
    std::printf("\r%60s\r", "");
    std::fflush(stdout);
    this->Drawn = false;
  }
}

} // namespace lightvolume
