// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkLightFieldProperty
 * @brief   how a light field is shown: mode, strength, scale, colours
 *
 * One property object is shared by everything that shows a light field: the
 * volume mapper (vtkLightTransportVolumeMapper), the slices and the colour
 * legend, so that the same fluence has the same colour everywhere. It is to a
 * light field what vtkVolumeProperty is to a volume. It holds no field and
 * touches no GL.
 *
 * A value phi (either sign, in the field's unit, power/length^2) becomes a
 * position t in a window [lo, hi] of magnitudes, 0 < lo < hi:
 *
 *   Logarithmic (default)   t = log(|phi| / lo) / log(hi / lo)
 *   Linear                  t = (|phi| - lo) / (hi - lo)
 *
 * clamped to [0,1]. t = 0 is no light. Equal ratios are equal steps of t in the
 * logarithmic scale: with the default six decades one decade is 1/6.
 * With AutomaticWindow (default) hi is the largest magnitude of the field and
 * lo = hi / 10^Decades (logarithmic) or 0 (linear). The maximum of a diffuse
 * field lies in its seeds, so the linear scale shows little more than those.
 *
 * t chooses a colour in PositiveColorMap where phi > 0 and in NegativeColorMap
 * where phi < 0, and an opacity LightOpacity * LightOpacityFunction(t).
 *
 * Modes (what the volume mapper does with a sample; s is the sample's colour,
 * c the light's, o = Strength * LightOpacity * LightOpacityFunction(t)):
 *
 * - Overlay (default): the tissue takes the light's colour, s + o (c - s), and
 *   the light itself is a glowing medium of that colour which hides the
 *   fraction o of what is behind it per LightOpacityUnitDistance. So a lit
 *   cavity shows although the transfer function makes it transparent.
 * - Illuminate: the tissue's colour is multiplied by 0.5 + 3.5 t (to 1 as
 *   Strength goes to 0), at most to white. Unlit tissue becomes dark; a negative
 *   fluence is no light.
 * - FluxDirection: as Overlay, with the flux E in place of phi: t from |E|, the
 *   colour (0.3 + 0.7 t) (|Ex|, |Ey|, |Ez|) / max(|Ex|, |Ey|, |Ez|), whose hue is
 *   that of diffusion tensor imaging: along x red, y green, z blue (patient axes
 *   if the world's axes are those).
 *
 * Changes of anything but Mode never rebuild a shader.
 *
 * This class is not for the volume's own look: that is vtkVolumeProperty.
 *
 * @sa vtkLightTransportVolumeMapper vtkLightFieldSlices
 */
#ifndef vtkLightFieldProperty_h
#define vtkLightFieldProperty_h

#include "vtkLightTransportRenderingModule.h" // for the export macro
#include "vtkObject.h"
#include "vtkSmartPointer.h" // for the functions

class vtkColorTransferFunction;
class vtkPiecewiseFunction;

class VTKLIGHTTRANSPORTRENDERING_EXPORT vtkLightFieldProperty : public vtkObject
{
public:
  static vtkLightFieldProperty* New();
  vtkTypeMacro(vtkLightFieldProperty, vtkObject);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  enum LightMode
  {
    Overlay = 0,
    Illuminate = 1,
    FluxDirection = 2
  };
  enum LightScale
  {
    Logarithmic = 0,
    Linear = 1
  };

  ///@{
  /** What the light does to the picture; Overlay by default. */
  void SetMode(int mode);
  vtkGetMacro(Mode, int);
  void SetModeToOverlay() { this->SetMode(Overlay); }
  void SetModeToIlluminate() { this->SetMode(Illuminate); }
  void SetModeToFluxDirection() { this->SetMode(FluxDirection); }
  const char* GetModeAsString();
  ///@}

  ///@{
  /**
   * From 0 (the picture without light, to the pixel) to 1 (default). Clamped.
   */
  void SetStrength(double strength);
  vtkGetMacro(Strength, double);
  ///@}

  ///@{
  /** Logarithmic by default. */
  void SetScale(int scale);
  vtkGetMacro(Scale, int);
  void SetScaleToLogarithmic() { this->SetScale(Logarithmic); }
  void SetScaleToLinear() { this->SetScale(Linear); }
  const char* GetScaleAsString();
  ///@}

  ///@{
  /**
   * How many powers of ten below the maximum the automatic logarithmic window
   * shows; 6 by default, clamped to [0.1, 30].
   */
  void SetDecades(double decades);
  vtkGetMacro(Decades, double);
  ///@}

  ///@{
  /**
   * Magnitudes shown, lo < hi, in the field's unit; setting one turns
   * AutomaticWindow off. A lo of 0 is for the linear scale: the logarithmic one
   * then takes hi / 10^Decades. Windows that are not finite or not 0 <= lo < hi
   * are refused with an error. Default: (1e-6, 1).
   */
  void SetWindow(double lo, double hi);
  void SetWindow(const double window[2]) { this->SetWindow(window[0], window[1]); }
  vtkGetVector2Macro(Window, double);
  ///@}

  ///@{
  /** Take the window from the field's largest magnitude; on by default. */
  vtkSetMacro(AutomaticWindow, bool);
  vtkGetMacro(AutomaticWindow, bool);
  vtkBooleanMacro(AutomaticWindow, bool);
  ///@}

  ///@{
  /**
   * Colours of positive and of negative fluence over t in [0,1]. Defaults, told
   * apart also by colour-blind readers: brown over orange to pale yellow, and
   * navy over blue to pale cyan. nullptr restores the default.
   */
  void SetPositiveColorMap(vtkColorTransferFunction* map);
  vtkColorTransferFunction* GetPositiveColorMap();
  void SetNegativeColorMap(vtkColorTransferFunction* map);
  vtkColorTransferFunction* GetNegativeColorMap();
  ///@}

  ///@{
  /**
   * Opacity of the strongest light over LightOpacityUnitDistance, in [0,1]
   * (clamped; 1 acts as 0.999). 0.9 by default. 0 leaves the picture as it is in
   * Overlay and FluxDirection.
   */
  void SetLightOpacity(double opacity);
  vtkGetMacro(LightOpacity, double);
  ///@}

  ///@{
  /**
   * Opacity over t in [0,1], as a fraction of LightOpacity. The default is 0 up
   * to t = 0.1 and rises to 1, so that the last decade is a haze and the light's
   * core is solid. nullptr restores the default.
   */
  void SetLightOpacityFunction(vtkPiecewiseFunction* function);
  vtkPiecewiseFunction* GetLightOpacityFunction();
  ///@}

  ///@{
  /**
   * World length over which LightOpacity is reached. 0 (default): 1/50 of the
   * volume's diagonal. Negative or non-finite values are refused with an error.
   */
  void SetLightOpacityUnitDistance(double distance);
  vtkGetMacro(LightOpacityUnitDistance, double);
  ///@}

  ///@{
  /**
   * Factor on the opacity of samples without light, in [0,1] (clamped); 0.4 by
   * default, so that the tissue in front veils the light less. Lit samples keep
   * their opacity: the factor is 1 - (1 - TissueOpacity) Strength (1 - lit), where
   * lit is LightOpacityFunction(t), or t in Illuminate. 1 leaves the tissue as the
   * transfer function has it; 0.02 looks into a volume whose samples are opaque.
   * Composite and isosurface blending only.
   */
  void SetTissueOpacity(double factor);
  vtkGetMacro(TissueOpacity, double);
  ///@}

  /**
   * The window used for a field whose largest magnitude is maximum. Returns
   * false, and (0, 0), where there is nothing to show: maximum is 0 or not
   * finite and the window is automatic.
   */
  bool GetEffectiveWindow(double maximum, double window[2]);

  /** t of phi in a window from GetEffectiveWindow, in [0,1]. 0 for a NaN. */
  double GetPosition(double phi, const double window[2]);

  /**
   * Colour and opacity (straight, Strength included) of phi for a field whose
   * largest magnitude is maximum: what the mapper shows for a sample.
   */
  void MapValue(double phi, double maximum, double rgba[4]);

  /** Also counts the colour maps and the opacity function. */
  vtkMTimeType GetMTime() override;

  /** Of the colour maps and the opacity function alone: when a table made of them is old. */
  vtkMTimeType GetTableMTime();

protected:
  vtkLightFieldProperty();
  ~vtkLightFieldProperty() override;

  int Mode = Overlay;
  int Scale = Logarithmic;
  double Strength = 1.;
  double Decades = 6.;
  double Window[2] = { 1e-6, 1. };
  bool AutomaticWindow = true;
  double LightOpacity = 0.9;
  double LightOpacityUnitDistance = 0.;
  double TissueOpacity = 0.4;
  vtkSmartPointer<vtkColorTransferFunction> PositiveColorMap;
  vtkSmartPointer<vtkColorTransferFunction> NegativeColorMap;
  vtkSmartPointer<vtkPiecewiseFunction> LightOpacityFunction;

private:
  vtkTimeStamp ExchangeTime; // of one of the three functions
  void SetClamped(double& member, double value, double lo, double hi, const char* name);

  vtkLightFieldProperty(const vtkLightFieldProperty&) = delete;
  void operator=(const vtkLightFieldProperty&) = delete;
};

#endif
