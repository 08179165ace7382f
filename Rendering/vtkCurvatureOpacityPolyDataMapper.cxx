// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkCurvatureOpacityPolyDataMapper.h"

#include "vtkCurvatureOpacityProperty.h"

#include "vtkActor.h"
#include "vtkCellArray.h"
#include "vtkCellData.h"
#include "vtkDataArray.h"
#include "vtkIdList.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkOpenGLBufferObject.h"
#include "vtkOpenGLCellToVTKCellMap.h"
#include "vtkOpenGLRenderWindow.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"
#include "vtkProperty.h"
#include "vtkRenderer.h"
#include "vtkShaderProgram.h"
#include "vtkTextureObject.h"

#include <unordered_map>
#include <vector>

class vtkCurvatureOpacityPolyDataMapper::vtkInternals
{
public:
  vtkSmartPointer<vtkTextureObject> Texture; // a shape's number per OpenGL primitive
  vtkSmartPointer<vtkOpenGLBufferObject> Buffer;
  vtkMTimeType BuiltTime = 0;
  vtkPolyData* BuiltInput = nullptr; // compared, never used
  int BuiltRepresentation = -1;
  std::string BuiltName;
  std::string Told;

  void Release(vtkWindow* window)
  {
    if (this->Texture)
    {
      this->Texture->ReleaseGraphicsResources(window);
      this->Texture = nullptr;
    }
    if (this->Buffer)
    {
      this->Buffer->ReleaseGraphicsResources();
      this->Buffer = nullptr;
    }
    this->BuiltTime = 0;
  }
};

vtkStandardNewMacro(vtkCurvatureOpacityPolyDataMapper);

//------------------------------------------------------------------------------
vtkCurvatureOpacityPolyDataMapper::vtkCurvatureOpacityPolyDataMapper()
  : Internals(new vtkInternals)
  , Property(vtkSmartPointer<vtkCurvatureOpacityProperty>::New())
{
}

//------------------------------------------------------------------------------
vtkCurvatureOpacityPolyDataMapper::~vtkCurvatureOpacityPolyDataMapper() = default;

//------------------------------------------------------------------------------
void vtkCurvatureOpacityPolyDataMapper::SetCurvatureOpacityProperty(
  vtkCurvatureOpacityProperty* property)
{
  // Not a modification: the superclass would build its shader again.
  this->Property = property;
  if (!property)
  {
    this->Property = vtkSmartPointer<vtkCurvatureOpacityProperty>::New();
  }
}

//------------------------------------------------------------------------------
vtkCurvatureOpacityProperty* vtkCurvatureOpacityPolyDataMapper::GetCurvatureOpacityProperty()
{
  return this->Property;
}

//------------------------------------------------------------------------------
void vtkCurvatureOpacityPolyDataMapper::SetShapeIdArray(const std::string& name)
{
  if (this->ShapeIdArray != name)
  {
    this->ShapeIdArray = name;
    this->Internals->Told.clear();
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkCurvatureOpacityPolyDataMapper::UpdateShapeIds(vtkRenderer* renderer)
{
  vtkInternals& self = *this->Internals;
  vtkPolyData* input = this->CurrentInput;
  auto* window = vtkOpenGLRenderWindow::SafeDownCast(renderer->GetRenderWindow());
  const int representation = self.BuiltRepresentation;
  vtkDataArray* ids = input->GetCellData()->GetArray(this->ShapeIdArray.c_str());
  const bool ofPoints = ids == nullptr;
  if (ofPoints)
  {
    ids = input->GetPointData()->GetArray(this->ShapeIdArray.c_str());
  }
  const vtkIdType expected = ofPoints ? input->GetNumberOfPoints() : input->GetNumberOfCells();
  std::string problem;
  if (!ids)
  {
    problem = "there is no cell or point array \"" + this->ShapeIdArray + "\"";
  }
  else if (ids->GetNumberOfComponents() != 1 || ids->GetNumberOfTuples() != expected)
  {
    problem = "the array \"" + this->ShapeIdArray + "\" has " +
      std::to_string(ids->GetNumberOfTuples()) + " tuples of " +
      std::to_string(ids->GetNumberOfComponents()) + " components, expected " +
      std::to_string(expected) + " of 1";
  }
  this->NumberOfShapes = 1;
  if (self.Told != problem)
  {
    self.Told = problem;
    if (!problem.empty())
    {
      vtkErrorMacro("The surface is one shape: " << problem << ".");
    }
  }
  if (!problem.empty())
  {
    self.Texture = nullptr;
    return;
  }

  // Equal values are one shape, numbered as they come.
  std::unordered_map<double, int> numbers;
  std::vector<float> ofPrimitive;
  vtkCellArray* cells[4] = { input->GetVerts(), input->GetLines(), input->GetPolys(),
    input->GetStrips() };
  this->CellCellMap->Update(cells, representation, input->GetPoints());
  const std::size_t primitives = this->CellCellMap->GetSize();
  ofPrimitive.reserve(primitives);
  vtkNew<vtkIdList> points;
  if (ofPoints)
  {
    input->BuildCells();
  }
  for (std::size_t i = 0; i < primitives; ++i)
  {
    vtkIdType id = this->CellCellMap->GetValue(i);
    if (ofPoints)
    {
      input->GetCellPoints(id, points);
      id = points->GetNumberOfIds() > 0 ? points->GetId(0) : 0;
    }
    const int next = static_cast<int>(numbers.size());
    ofPrimitive.push_back(
      static_cast<float>(numbers.emplace(ids->GetComponent(id, 0), next).first->second));
  }
  this->NumberOfShapes = std::max(1, static_cast<int>(numbers.size()));
  if (ofPrimitive.empty())
  {
    ofPrimitive.push_back(0.F);
  }
  if (!self.Texture)
  {
    self.Texture = vtkSmartPointer<vtkTextureObject>::New();
    self.Buffer = vtkSmartPointer<vtkOpenGLBufferObject>::New();
    self.Buffer->SetType(vtkOpenGLBufferObject::TextureBuffer);
  }
  self.Texture->SetContext(window);
  self.Buffer->Upload(ofPrimitive, vtkOpenGLBufferObject::TextureBuffer);
  self.Texture->CreateTextureBuffer(
    static_cast<unsigned int>(ofPrimitive.size()), 1, VTK_FLOAT, self.Buffer);
}

//------------------------------------------------------------------------------
void vtkCurvatureOpacityPolyDataMapper::RenderPieceStart(vtkRenderer* renderer, vtkActor* actor)
{
  this->Superclass::RenderPieceStart(renderer, actor);
  vtkInternals& self = *this->Internals;
  if (this->ShapeIdArray.empty())
  {
    self.Texture = nullptr;
    self.BuiltTime = 0;
    this->NumberOfShapes = 1;
    return;
  }
  const int representation = actor->GetProperty()->GetRepresentation();
  const vtkMTimeType time = this->CurrentInput->GetMTime();
  if (self.BuiltTime != time || self.BuiltInput != this->CurrentInput ||
    self.BuiltRepresentation != representation || self.BuiltName != this->ShapeIdArray)
  {
    self.BuiltTime = time;
    self.BuiltInput = this->CurrentInput;
    self.BuiltRepresentation = representation;
    self.BuiltName = this->ShapeIdArray;
    this->UpdateShapeIds(renderer);
  }
  if (self.Texture)
  {
    self.Texture->Activate();
  }
}

//------------------------------------------------------------------------------
void vtkCurvatureOpacityPolyDataMapper::RenderPieceFinish(vtkRenderer* renderer, vtkActor* actor)
{
  if (this->Internals->Texture)
  {
    this->Internals->Texture->Deactivate();
  }
  this->Superclass::RenderPieceFinish(renderer, actor);
}

//------------------------------------------------------------------------------
bool vtkCurvatureOpacityPolyDataMapper::HasShapeIds() const
{
  return this->Internals->Texture != nullptr;
}

//------------------------------------------------------------------------------
void vtkCurvatureOpacityPolyDataMapper::SetShapeIds(vtkShaderProgram* program)
{
  if (this->Internals->Texture && program->IsUniformUsed("ltShapeIds"))
  {
    program->SetUniformi("ltShapeIds", this->Internals->Texture->GetTextureUnit());
  }
}

//------------------------------------------------------------------------------
void vtkCurvatureOpacityPolyDataMapper::ReleaseGraphicsResources(vtkWindow* window)
{
  this->Internals->Release(window);
  this->Superclass::ReleaseGraphicsResources(window);
}

//------------------------------------------------------------------------------
void vtkCurvatureOpacityPolyDataMapper::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "ShapeIdArray: " << this->ShapeIdArray << "\n";
  os << indent << "NumberOfShapes: " << this->NumberOfShapes << "\n";
  os << indent << "CurvatureOpacityProperty:\n";
  this->Property->PrintSelf(os, indent.GetNextIndent());
}
