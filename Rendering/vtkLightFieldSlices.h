// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkLightFieldSlices
 * @brief   three orthogonal slices of a volume with a light field laid over them
 *
 * Fills a rectangle of a render window with three slices through one point, in
 * the colours of a vtkLightFieldProperty (the same as the volume mapper's), and
 * a colour legend. The light has a grid of its own: coarser, shifted or turned
 * against the anatomy's.
 *
 *   vtkNew<vtkLightFieldSlices> slices;
 *   slices->SetInputConnection(reader->GetOutputPort());
 *   slices->SetLightFieldConnection(diffusion->GetOutputPort());
 *   slices->SetPatientAxes(vtkLightFieldSlices::RAS);
 *   slices->AddToRenderWindow(window);
 *   window->Render();
 *
 * From then on changing a seed upstream, the position or a colour map and
 * calling Render is enough: when the window starts to render, both pipelines
 * are brought up to date, and what has changed, only that, is made anew.
 *
 * The stages of an update:
 * 1. Axes. Slices follow the volume's own axes (its direction matrix), so no
 *    slice of an oblique scan is blurred. If it is known what the world's axes
 *    are in the patient (SetPatientAxes), each volume axis is given to the
 *    patient axis it is closest to; the slices are then axial, coronal and
 *    sagittal, in the radiological convention by default, and marked R/L, A/P,
 *    S/I. Else they are perpendicular to the volume's k, j and i axes, and
 *    carry no marks.
 * 2. Position. The planes go through the voxel that is nearest to Position, by
 *    default to the strongest light.
 * 3. Colours. The anatomy is linear between neighbours in the plane, grey
 *    between two percentiles of the data unless a window is set; NaN is black.
 *    8-bit images of three or four components are shown as colours. The light
 *    is trilinear in its own grid; NaN there is no light. The property's Overlay
 *    and FluxDirection are as in the volume; in its Illuminate, which darkens
 *    what is unlit, slices show the Overlay, as anatomy is what they are for.
 * 4. Layout. All slices have one scale (world length per pixel), whatever the
 *    spacing of the axes, as large as the rectangle allows.
 *
 * The scene of each slice is in world coordinates: props added to
 * GetSliceRenderer() lie where they belong, and DisplayToWorld() gives the point
 * under a pixel, for instance to set a seed there.
 *
 * Lengths are in the unit of the spacing, colours' values in the field's unit.
 *
 * Arrays: the anatomy's point scalars (SetInputArrayToProcess(0, ...) chooses
 * others); of the light field the point arrays Fluence and, for arrows and for
 * the property's FluxDirection, Flux (three world components).
 *
 * Not for oblique reformats, nor for images without a third axis that should
 * fill the window (a 2-D image is shown, with two thin strips beside it).
 *
 * @sa vtkLightFieldProperty vtkLightTransportVolumeMapper vtkLightDiffusionFilter
 */
#ifndef vtkLightFieldSlices_h
#define vtkLightFieldSlices_h

#include "vtkAlgorithm.h"
#include "vtkLightTransportRenderingModule.h" // for the export macro

#include <memory> // for std::unique_ptr
#include <string> // for std::string

class vtkImageData;
class vtkLightFieldProperty;
class vtkPolyData;
class vtkRenderWindow;
class vtkRenderer;

class VTKLIGHTTRANSPORTRENDERING_EXPORT vtkLightFieldSlices : public vtkAlgorithm
{
public:
  static vtkLightFieldSlices* New();
  vtkTypeMacro(vtkLightFieldSlices, vtkAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  /** The three slices, in the order of all functions that take a slice's number. */
  enum SliceNumber
  {
    Axial = 0,    // unknown orientation: perpendicular to the volume's k axis
    Coronal = 1,  // j
    Sagittal = 2, // i
    NumberOfSlices = 3
  };

  ///@{
  /** The anatomy (port 0, needed). SetInputConnection is vtkAlgorithm's. */
  void SetInputData(vtkImageData* anatomy);
  ///@}

  ///@{
  /** The light field (port 1); without one the anatomy alone is shown. */
  void SetLightFieldConnection(vtkAlgorithmOutput* light);
  void SetLightFieldData(vtkImageData* light);
  ///@}

  ///@{
  /** Colours, scale and window of the light. Never null; nullptr makes a new one. */
  void SetLightFieldProperty(vtkLightFieldProperty* property);
  vtkLightFieldProperty* GetLightFieldProperty();
  ///@}

  ///@{
  /**
   * Fill the rectangle (0..1 of the window, y upwards) of the window; a second
   * call moves there. The window is not kept alive by this object.
   */
  void AddToRenderWindow(
    vtkRenderWindow* window, double x0 = 0., double y0 = 0., double x1 = 1., double y1 = 1.);
  void RemoveFromRenderWindow();
  vtkRenderWindow* GetRenderWindow();
  ///@}

  ///@{
  /**
   * The point that all slices go through, in world coordinates. Without one
   * (default; ClearPosition()) it is where the fluence is largest, or largest in
   * magnitude where none is positive, or the middle of the volume without light.
   * A point outside the volume is moved to the nearest slice. GetPosition() is
   * the voxel used; up to date after Update().
   */
  void SetPosition(double x, double y, double z);
  void SetPosition(const double position[3])
  {
    this->SetPosition(position[0], position[1], position[2]);
  }
  void ClearPosition();
  double* GetPosition() VTK_SIZEHINT(3) { return this->UsedPosition; }
  ///@}

  enum PatientAxesType
  {
    Unknown = 0,
    RAS = 1, // x to the right, y anterior, z superior (NIfTI)
    LPS = 2  // x to the left, y posterior, z superior (DICOM, ITK)
  };
  ///@{
  /** What the world's axes are in the patient; Unknown by default: no marks. */
  vtkSetMacro(PatientAxes, int);
  vtkGetMacro(PatientAxes, int);
  ///@}

  enum ConventionType
  {
    Radiological = 0,
    Neurological = 1
  };
  ///@{
  /**
   * Radiological (default): the patient's left is on the viewer's right in axial
   * and coronal slices, as if seen from the feet and from the front.
   * Neurological: on the viewer's left. Sagittal slices have anterior on the
   * viewer's left in both.
   */
  vtkSetMacro(Convention, int);
  vtkGetMacro(Convention, int);
  void SetConventionToRadiological() { this->SetConvention(Radiological); }
  void SetConventionToNeurological() { this->SetConvention(Neurological); }
  ///@}

  ///@{
  /**
   * Grey values: black at level - window/2, white at level + window/2. Without
   * them (default; ClearWindowLevel()) black is the 0.5th and white the 99.5th
   * percentile of the finite values. A negative window inverts. The getters give
   * what is used, after Update().
   */
  void SetWindowLevel(double window, double level);
  void ClearWindowLevel();
  vtkGetMacro(ColorWindow, double);
  vtkGetMacro(ColorLevel, double);
  ///@}

  ///@{
  /** Which component of the anatomy is shown if it isn't colours; 0 by default. */
  vtkSetMacro(Component, int);
  vtkGetMacro(Component, int);
  ///@}

  ///@{
  /** Arrows of the flux in the plane (002, fig. 4.6); off by default. */
  vtkSetMacro(ShowArrows, bool);
  vtkGetMacro(ShowArrows, bool);
  vtkBooleanMacro(ShowArrows, bool);
  ///@}

  enum ArrowLengthType
  {
    LogarithmicLength = 0,
    UniformLength = 1
  };
  ///@{
  /**
   * LogarithmicLength (default): proportional to 1 + log10(e/E)/decades, e the
   * flux in the plane, E the field's largest, decades as in the property; below
   * the last decade there is no arrow. UniformLength: all of one length.
   */
  vtkSetMacro(ArrowLength, int);
  vtkGetMacro(ArrowLength, int);
  ///@}

  ///@{
  /** How many arrows fit side by side along the longest side (of what is seen, if
   * zoomed); 20 by default, 1..200. */
  vtkSetClampMacro(NumberOfArrowsAlong, int, 1, 200);
  vtkGetMacro(NumberOfArrowsAlong, int);
  ///@}

  ///@{
  /** What else is drawn; all on by default. */
  vtkSetMacro(ShowCrosshair, bool);
  vtkGetMacro(ShowCrosshair, bool);
  vtkBooleanMacro(ShowCrosshair, bool);
  vtkSetMacro(ShowMarks, bool);
  vtkGetMacro(ShowMarks, bool);
  vtkBooleanMacro(ShowMarks, bool);
  vtkSetMacro(ShowCaptions, bool);
  vtkGetMacro(ShowCaptions, bool);
  vtkBooleanMacro(ShowCaptions, bool);
  vtkSetMacro(ShowLegend, bool);
  vtkGetMacro(ShowLegend, bool);
  vtkBooleanMacro(ShowLegend, bool);
  ///@}

  ///@{
  /**
   * Text for the legend and the captions. Defaults: "power/length^2" with a
   * raised 2 for fluence and flux, and no unit for lengths.
   */
  vtkSetMacro(FluenceUnits, std::string);
  vtkGetMacro(FluenceUnits, std::string);
  vtkSetMacro(LengthUnits, std::string);
  vtkGetMacro(LengthUnits, std::string);
  ///@}

  enum LayoutType
  {
    Automatic = 0,
    Row = 1,
    Grid = 2
  };
  ///@{
  /**
   * Row: the slices side by side, the legend to their right. Grid: coronal below
   * axial, sagittal to its right, so that edges line up; the legend in the free
   * corner. Automatic (default): the one that shows the slices larger.
   */
  vtkSetMacro(Layout, int);
  vtkGetMacro(Layout, int);
  ///@}

  ///@{
  /**
   * Magnification, 1 (default: the slices fit) or more: then Position is in the
   * middle of each slice's part of the window, and what is outside is cut off.
   */
  void SetZoom(double zoom);
  vtkGetMacro(Zoom, double);
  ///@}

  /**
   * Bring pipelines, slices and layout up to date; what the window does when it
   * renders. Bad input is reported once, and shows nothing (or the anatomy alone
   * if only the light is bad).
   */
  using vtkAlgorithm::Update;
  void Update() override;

  /** How often slices were made anew: stays as it is while nothing changes. */
  vtkGetMacro(NumberOfBuilds, int);

  ///@{
  /**
   * The parts. Renderers exist after AddToRenderWindow(); image and arrows after
   * Update(). The image is RGB, its first row the lowest on screen. Arrow n of
   * the polydata has the points 4n (tail), 4n+1 (tip), 4n+2, 4n+3 (its head), in
   * world coordinates.
   */
  vtkRenderer* GetSliceRenderer(int slice);
  vtkRenderer* GetLegendRenderer();
  vtkImageData* GetSliceImage(int slice);
  vtkPolyData* GetArrows(int slice);
  ///@}

  /**
   * The letters at the "left", "right", "bottom" and "top" of a slice, as one
   * string in this order, e.g. "RLPA" for an axial slice; empty if unknown.
   */
  std::string GetMarks(int slice);

  /**
   * The world point of the slice under a pixel of the window (y upwards). False
   * where there is no slice. Of the layout of the last Update().
   */
  bool DisplayToWorld(double x, double y, double world[3]);

  /** Counts the property too. */
  vtkMTimeType GetMTime() override;

protected:
  vtkLightFieldSlices();
  ~vtkLightFieldSlices() override;

  int FillInputPortInformation(int port, vtkInformation* info) override;

  double UsedPosition[3] = { 0., 0., 0. };
  double WantedPosition[3] = { 0., 0., 0. };
  bool HasPosition = false;
  int PatientAxes = Unknown;
  int Convention = Radiological;
  double ColorWindow = 1.;
  double ColorLevel = 0.5;
  bool HasWindowLevel = false;
  int Component = 0;
  bool ShowArrows = false;
  int ArrowLength = LogarithmicLength;
  int NumberOfArrowsAlong = 20;
  bool ShowCrosshair = true;
  bool ShowMarks = true;
  bool ShowCaptions = true;
  bool ShowLegend = true;
  std::string FluenceUnits = "power/length\xc2\xb2";
  std::string LengthUnits;
  int Layout = Automatic;
  double Zoom = 1.;
  int NumberOfBuilds = 0;

private:
  vtkLightFieldSlices(const vtkLightFieldSlices&) = delete;
  void operator=(const vtkLightFieldSlices&) = delete;

  class vtkInternals;
  std::unique_ptr<vtkInternals> Internals;
};

#endif
