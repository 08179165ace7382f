// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "VtkErrors.h"

#include "vtkLogger.h"
#include "vtkObjectFactory.h"

#include <algorithm>

namespace lightvolume
{
class VtkErrors::Observer : public vtkCommand
{
public:
  static Observer* New() { return new Observer; }
  void Execute(vtkObject*, unsigned long event, void* data) override
  {
    this->Keep(data ? static_cast<const char*>(data) : "", event == vtkCommand::ErrorEvent);
  }
  void Keep(std::string text, bool isError)
  {
    // "ERROR: In FILE, line N\nvtkClass (0x...): message\n\n"
    const std::size_t newline = text.find('\n');
    if (newline != std::string::npos && text.find("In ") < newline)
    {
      text.erase(0, newline + 1);
    }
    const std::size_t address = text.find("): ");
    if (address != std::string::npos && text.compare(0, 3, "vtk") == 0)
    {
      text.erase(0, address + 3);
    }
    while (!text.empty() && (text.back() == '\n' || text.back() == ' '))
    {
      text.pop_back();
    }
    std::replace(text.begin(), text.end(), '\n', ' ');
    (isError ? this->Errors : this->Warnings).push_back(text);
  }
  std::vector<std::string> Errors;
  std::vector<std::string> Warnings;
};

// Takes the place of VTK's output window.
class VtkErrors::Window : public vtkOutputWindow
{
public:
  vtkTypeMacro(Window, vtkOutputWindow);
  static Window* New();
  void DisplayErrorText(const char* text) override { this->Listener->Keep(text, true); }
  void DisplayWarningText(const char* text) override { this->Listener->Keep(text, false); }
  void DisplayGenericWarningText(const char* text) override { this->Listener->Keep(text, false); }
  void DisplayText(const char*) override {}
  vtkSmartPointer<Observer> Listener;
};
vtkStandardNewMacro(VtkErrors::Window);

VtkErrors::VtkErrors()
  : Listener(vtkSmartPointer<Observer>::New())
  , Before(vtkOutputWindow::GetInstance())
{
  const auto window = vtkSmartPointer<Window>::New();
  window->Listener = this->Listener;
  vtkOutputWindow::SetInstance(window);
  vtkLogger::SetStderrVerbosity(vtkLogger::VERBOSITY_OFF);
}

VtkErrors::~VtkErrors()
{
  for (const auto& object : this->Watched)
  {
    object->RemoveObserver(this->Listener);
  }
  vtkOutputWindow::SetInstance(this->Before);
  if (!this->Before->IsA("Window"))
  {
    vtkLogger::SetStderrVerbosity(vtkLogger::VERBOSITY_INFO);
  }
}

void VtkErrors::Watch(vtkObject* object)
{
  const auto add = [this](vtkObject* one)
  {
    one->AddObserver(vtkCommand::ErrorEvent, this->Listener);
    one->AddObserver(vtkCommand::WarningEvent, this->Listener);
    this->Watched.emplace_back(one);
  };
  add(object);
  if (auto* algorithm = vtkAlgorithm::SafeDownCast(object))
  {
    add(algorithm->GetExecutive());
  }
}

bool VtkErrors::Any() const
{
  return !this->Listener->Errors.empty();
}

std::string VtkErrors::First() const
{
  return this->Any() ? this->Listener->Errors.front() : std::string();
}

std::string VtkErrors::Because() const
{
  return this->Any() ? ": " + this->First() : std::string();
}

const std::vector<std::string>& VtkErrors::Warnings() const
{
  return this->Listener->Warnings;
}

void VtkErrors::Clear()
{
  this->Listener->Errors.clear();
  this->Listener->Warnings.clear();
}

} // namespace lightvolume
