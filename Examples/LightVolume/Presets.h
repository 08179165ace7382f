// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * What an unknown volume should look like and where its light should start: from its values.
 */
#ifndef LightVolume_Presets_h
#define LightVolume_Presets_h

#include "Options.h"
#include "Volume.h"

#include "vtkColorTransferFunction.h"
#include "vtkPiecewiseFunction.h"

namespace lightvolume
{
struct Statistics
{
  double Minimum = 0.;
  double Maximum = 0.;
  /** Between the dark and the bright half of the histogram (Otsu 1979): air and the rest. */
  double Threshold = 0.;
  double AboveThreshold = 0.;    // fraction of the voxels
  std::vector<double> Histogram; // 1024 bins from Minimum to Maximum
  double NoDataFraction = 0.;

  /** The value below which this fraction of the voxels above `above` lies. */
  double Quantile(double fraction, double above) const;
  /** Zero lies inside: amplitudes, not densities. */
  bool IsSigned() const { return Minimum < 0. && -Minimum > .2 * Maximum && Maximum > 0.; }
};

/** Of the finite values that are not declared no data; an Error where there is none. */
Statistics Measure(const Volume& volume);

struct Look
{
  std::string Preset; // ct, mr or seismic
  std::string Why;    // when it was chosen automatically
  vtkSmartPointer<vtkColorTransferFunction> Color;
  vtkSmartPointer<vtkPiecewiseFunction> Opacity;
  vtkSmartPointer<vtkPiecewiseFunction> GradientOpacity; // may be null
  bool Shade = true;
  std::string Mapping = "gradient";
  double GradientScaleFactor = 1.;
  std::string Absorption = "complement";
  double Albedo = .99;
  vtkSmartPointer<vtkPiecewiseFunction> Passage; // of the transfer mappings; null: the opacity
  double Reach = 0.;
  double LightOpacity = .9;
  double TissueOpacity = 1.;
};

Look ChooseLook(const Volume& volume, const Statistics& statistics, const Options& options);

/**
 * Where light starts that nobody placed, as a voxel of Image, from 0: the middle of the widest even
 * region that is not air; of signed data, whose zero means nothing, the strongest positive value,
 * rather near the middle. `how` says which.
 */
std::array<double, 3> DefaultSeed(
  const Volume& volume, const Statistics& statistics, std::string& how);

} // namespace lightvolume

#endif
