// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * What VTK objects report while one of these exists, kept instead of printed: one line for the
 * user is made of it. Objects that are not watched (a reader's own XML parser, say) are heard too.
 */
#ifndef LightVolume_VtkErrors_h
#define LightVolume_VtkErrors_h

#include "vtkAlgorithm.h"
#include "vtkCommand.h"
#include "vtkExecutive.h"
#include "vtkOutputWindow.h"
#include "vtkSmartPointer.h"

#include <string>
#include <vector>

namespace lightvolume
{
class VtkErrors
{
public:
  VtkErrors();
  ~VtkErrors();
  VtkErrors(const VtkErrors&) = delete;
  void operator=(const VtkErrors&) = delete;

  /** Errors and warnings of this object, and of the executive that runs it. */
  void Watch(vtkObject* object);

  bool Any() const;
  /** The first error without VTK's "ERROR: In file, line" head; empty without one. */
  std::string First() const;
  /** ": " and the first error, or nothing. */
  std::string Because() const;
  const std::vector<std::string>& Warnings() const;
  void Clear();

private:
  class Observer;
  class Window;
  vtkSmartPointer<Observer> Listener;
  std::vector<vtkSmartPointer<vtkObject>> Watched;
  vtkSmartPointer<vtkOutputWindow> Before;
};

} // namespace lightvolume

#endif
