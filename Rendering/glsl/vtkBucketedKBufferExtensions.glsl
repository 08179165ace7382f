// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkBucketedKBufferPass: right after VTK::System::Dec, where VTK writes #version 150
// (9.1 to 9.6 at least). All of it is part of OpenGL 4.3.
#extension GL_ARB_shader_image_load_store : require
#extension GL_ARB_shading_language_420pack : require
#extension GL_ARB_shading_language_packing : require
#extension GL_ARB_shader_bit_encoding : require
