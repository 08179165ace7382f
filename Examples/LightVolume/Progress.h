// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * A line that says how far a stage is, once it has taken a second: redrawn in place on a
 * terminal, plain lines elsewhere.
 */
#ifndef LightVolume_Progress_h
#define LightVolume_Progress_h

#include "vtkAlgorithm.h"
#include "vtkCommand.h"
#include "vtkSmartPointer.h"

#include <chrono>
#include <string>
#include <utility>
#include <vector>

namespace lightvolume
{
class Progress
{
public:
  explicit Progress(bool quiet);
  ~Progress();
  Progress(const Progress&) = delete;
  void operator=(const Progress&) = delete;

  /** Begin a stage; its filter, if any, tells how far it is. */
  void Begin(const std::string& stage, vtkAlgorithm* filter = nullptr);
  /** In [0, 1]; may be called by what is not a filter. */
  void Show(double fraction);
  /** Ends the stage and returns its seconds. */
  double End();

  /** A line for the user, below whatever is on the terminal. */
  void Say(const std::string& line);

  const std::vector<std::pair<std::string, double>>& Stages() const { return this->Times; }

private:
  class Observer;
  using Clock = std::chrono::steady_clock;
  bool Quiet;
  bool Terminal;
  bool Drawn = false;
  std::string Stage;
  Clock::time_point Started;
  Clock::time_point LastShown;
  vtkSmartPointer<vtkAlgorithm> Filter;
  vtkSmartPointer<Observer> Listener;
  unsigned long Tag = 0;
  std::vector<std::pair<std::string, double>> Times;

  void Erase();
};

} // namespace lightvolume

#endif
