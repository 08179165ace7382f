// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkCurvatureOpacityPolyDataMapper
 * @brief   a surface with its own stylisation in a vtkBucketedKBufferPass
 *
 * Draws what vtkOpenGLPolyDataMapper draws. Where a vtkBucketedKBufferPass draws
 * the translucent surfaces, this one is stylised by a property of its own instead
 * of the pass's, and may consist of several shapes, told apart by an array: a
 * fragment's neighbours are looked for on its own shape only.
 *
 * @code
 *   mapper->SetShapeIdArray("PartNumber");
 *   mapper->GetCurvatureOpacityProperty()->CurvatureOpacityOn();
 * @endcode
 *
 * Without such a pass it is its superclass. An opaque actor takes part where its property
 * has an effect (see vtkCurvatureOpacityProperty). Any other mapper can be drawn by the pass
 * too: its actor, or each block of a composite, is then one shape with the pass's
 * property.
 *
 * @sa vtkBucketedKBufferPass vtkCurvatureOpacityProperty
 */
#ifndef vtkCurvatureOpacityPolyDataMapper_h
#define vtkCurvatureOpacityPolyDataMapper_h

#include "vtkLightTransportRenderingModule.h" // for the export macro
#include "vtkOpenGLPolyDataMapper.h"
#include "vtkSmartPointer.h" // for the property

#include <memory> // for the implementation
#include <string> // for the array's name

class vtkCurvatureOpacityProperty;
class vtkShaderProgram;

class VTKLIGHTTRANSPORTRENDERING_EXPORT vtkCurvatureOpacityPolyDataMapper
  : public vtkOpenGLPolyDataMapper
{
public:
  static vtkCurvatureOpacityPolyDataMapper* New();
  vtkTypeMacro(vtkCurvatureOpacityPolyDataMapper, vtkOpenGLPolyDataMapper);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /** How this surface is stylised; setting nullptr makes a default one: not at all. */
  void SetCurvatureOpacityProperty(vtkCurvatureOpacityProperty* property);
  vtkCurvatureOpacityProperty* GetCurvatureOpacityProperty();
  ///@}

  ///@{
  /**
   * A cell array, or else a point array (that of a cell's first point counts), with one
   * component; equal values are one shape. Up to 16777215 shapes in a picture. An
   * empty name (default): the actor is one shape; so, after one error, where there is
   * no such array.
   */
  void SetShapeIdArray(const std::string& name);
  const std::string& GetShapeIdArray() const { return this->ShapeIdArray; }
  ///@}

  /** How many shapes there are, after the first frame; 1 without an array. */
  vtkGetMacro(NumberOfShapes, int);

  void ReleaseGraphicsResources(vtkWindow* window) override;

  ///@{
  /** For vtkBucketedKBufferPass: whether the shader needs the array, and its texture. */
  bool HasShapeIds() const;
  void SetShapeIds(vtkShaderProgram* program);
  ///@}

protected:
  vtkCurvatureOpacityPolyDataMapper();
  ~vtkCurvatureOpacityPolyDataMapper() override;

  void RenderPieceStart(vtkRenderer* renderer, vtkActor* actor) override;
  void RenderPieceFinish(vtkRenderer* renderer, vtkActor* actor) override;

  std::string ShapeIdArray;
  int NumberOfShapes = 1;

private:
  class vtkInternals;
  std::unique_ptr<vtkInternals> Internals;
  vtkSmartPointer<vtkCurvatureOpacityProperty> Property;

  void UpdateShapeIds(vtkRenderer* renderer);

  vtkCurvatureOpacityPolyDataMapper(const vtkCurvatureOpacityPolyDataMapper&) = delete;
  void operator=(const vtkCurvatureOpacityPolyDataMapper&) = delete;
};

#endif
