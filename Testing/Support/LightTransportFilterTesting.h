// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * What tests of the filters need on top of LightTransportTesting.h: errors that
 * are observed and not printed, images made from a function of the voxel, and
 * the sum of an array.
 *
 *   LT_CHECK_FAILS(suite, filter, "BetaFloor", "(0, 1]");
 *
 * updates the filter and checks that it reports exactly one error, which holds
 * these words, and that its output is empty.
 */
#ifndef LightTransportFilterTesting_h
#define LightTransportFilterTesting_h

#include "LightTransportTesting.h"

#include "vtkAlgorithm.h"
#include "vtkCommand.h"
#include "vtkDataArray.h"
#include "vtkExecutive.h"
#include "vtkImageData.h"
#include "vtkNew.h"
#include "vtkPointData.h"
#include "vtkSmartPointer.h"

#include <initializer_list>
#include <string>
#include <vector>

namespace lighttransport
{
namespace testing
{
/** For bad input: comparing a NaN raises a floating-point exception, and is meant to. */
inline void allowFloatingPointExceptions()
{
#if defined(__GLIBC__)
  fedisableexcept(FE_ALL_EXCEPT);
#endif
}

/** Keeps the errors and warnings of the objects that it observes. */
class MessageLog : public vtkCommand
{
public:
  static MessageLog* New() { return new MessageLog; }
  void Execute(vtkObject*, unsigned long, void* text) override
  {
    this->messages.emplace_back(text ? static_cast<const char*>(text) : "");
  }
  std::vector<std::string> messages;
};

/** Updates; returns the algorithm's own errors. Those of its executive are silenced. */
inline std::vector<std::string> errorsOfUpdate(vtkAlgorithm* algorithm)
{
  vtkNew<MessageLog> own;
  vtkNew<MessageLog> executive;
  const unsigned long ownTag = algorithm->AddObserver(vtkCommand::ErrorEvent, own);
  const unsigned long executiveTag =
    algorithm->GetExecutive()->AddObserver(vtkCommand::ErrorEvent, executive);
  algorithm->Update();
  algorithm->RemoveObserver(ownTag);
  algorithm->GetExecutive()->RemoveObserver(executiveTag);
  return own->messages;
}

inline void checkFails(Suite& suite, vtkAlgorithm* algorithm,
  std::initializer_list<const char*> words, const char* file, int line)
{
  const std::vector<std::string> errors = errorsOfUpdate(algorithm);
  suite.check(errors.size() == 1, "one error, not " + std::to_string(errors.size()), file, line);
  for (const char* word : words)
  {
    for (const std::string& error : errors)
    {
      suite.check(error.find(word) != std::string::npos,
        "\"" + std::string(word) + "\" in: " + error, file, line);
    }
  }
  auto* output = vtkImageData::SafeDownCast(algorithm->GetOutputDataObject(0));
  suite.check(
    output && output->GetNumberOfPoints() == 0 && output->GetPointData()->GetNumberOfArrays() == 0,
    "an empty output", file, line);
}

/** An image whose scalars are f(i, j, k), with extents from 0. */
template <class F>
vtkSmartPointer<vtkImageData> makeImage(int nx, int ny, int nz, int scalarType, const F& f)
{
  auto image = vtkSmartPointer<vtkImageData>::New();
  image->SetDimensions(nx, ny, nz);
  image->AllocateScalars(scalarType, 1);
  vtkDataArray* scalars = image->GetPointData()->GetScalars();
  vtkIdType at = 0;
  for (int k = 0; k < nz; ++k)
  {
    for (int j = 0; j < ny; ++j)
    {
      for (int i = 0; i < nx; ++i)
      {
        scalars->SetComponent(at++, 0, f(i, j, k));
      }
    }
  }
  return image;
}

inline vtkDataArray* pointArray(vtkAlgorithm* algorithm, const char* name)
{
  auto* output = vtkImageData::SafeDownCast(algorithm->GetOutputDataObject(0));
  return output ? output->GetPointData()->GetArray(name) : nullptr;
}

inline double sumOf(vtkDataArray* array)
{
  double sum = 0.;
  for (vtkIdType i = 0; array && i < array->GetNumberOfTuples(); ++i)
  {
    sum += array->GetComponent(i, 0);
  }
  return sum;
}
} // namespace testing
} // namespace lighttransport

#define LT_CHECK_FAILS(suite, algorithm, ...)                                                      \
  lighttransport::testing::checkFails((suite), (algorithm), { __VA_ARGS__ }, __FILE__, __LINE__)

#endif
