// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/** A source of light fields that can be moved, and made to fail. */
#ifndef LightSource_h
#define LightSource_h

#include "VolumeMapperScene.h"

#include "vtkImageAlgorithm.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkObjectFactory.h"
#include "vtkStreamingDemandDrivenPipeline.h"

class LightSource : public vtkImageAlgorithm
{
public:
  static LightSource* New();
  vtkTypeMacro(LightSource, vtkImageAlgorithm);

  void SetPlace(double x, double y, double z)
  {
    this->Place = { x, y, z };
    this->Modified();
  }
  vtkSetMacro(Fail, bool);
  vtkSetMacro(Empty, bool);
  int Runs = 0;

protected:
  LightSource() { this->SetNumberOfInputPorts(0); }

  int RequestInformation(
    vtkInformation*, vtkInformationVector**, vtkInformationVector* output) override
  {
    const int extent[6] = { 0, 11, 0, 11, 0, 11 };
    vtkInformation* info = output->GetInformationObject(0);
    info->Set(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT(), extent, 6);
    return 1;
  }
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector* output) override
  {
    ++this->Runs;
    vtkImageData* image = vtkImageData::GetData(output);
    if (this->Fail)
    {
      vtkErrorMacro("no light today");
      image->Initialize();
      return 0;
    }
    if (this->Empty)
    {
      image->Initialize();
      return 1;
    }
    image->SetDimensions(12, 12, 12);
    image->SetSpacing(1.8, 1.8, 1.8);
    lighttransport::testing::setFluence(image,
      [this](const lighttransport::testing::Point& p)
      { return lighttransport::testing::glow(p, this->Place, 1.); });
    return 1;
  }

  lighttransport::testing::Point Place = { { 7., 8., 11. } };
  bool Fail = false;
  bool Empty = false;
};

vtkStandardNewMacro(LightSource);

#endif
