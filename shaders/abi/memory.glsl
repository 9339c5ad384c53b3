// SPDX-License-Identifier: Apache-2.0
// Device addresses as typed arrays: `Vec4s(address).v[i]`. Each block has exactly one member.
#ifndef OOCPT_MEMORY_GLSL
#define OOCPT_MEMORY_GLSL

#include "abi/abi.glsl"

layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer FrameBlock { FrameConstants f; };
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer CountersBlock { WavefrontCounters c; };

layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer StreamingBlock { StreamingPointers s; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer RouletteBlock { RouletteStats r; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer AdaptiveBlock { AdaptiveSampling a; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer PathAutomatonBlock { GpuPathAutomaton a; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer PathStatesBlock { GpuPathStates s; };
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer TextureFeedbackBlock { TextureFeedback t; };
// Host memory that the host writes while passes run.
layout(buffer_reference, scalar, buffer_reference_align = 4) volatile readonly buffer HostWords { uint v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer DemandList { UnitDemand v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer Segments { PathSegment v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer PendingLists { PendingItems v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer DeferredAlphaTests { DeferredAlphaTest v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer Surfaces { GpuSurface v[]; };

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer ConstVec4s { vec4 v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Instances { GpuInstance v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer MotionKeys { GpuMotionKey v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer CameraMotionBlock { GpuCameraMotion m; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer CameraKeys { GpuCameraKey v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer ClipPlanes { ClipPlane v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer ChunkInstances { GpuChunkInstance v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer Chunks { GpuChunk v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Assemblies { GpuAssembly v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer Meshes { GpuMesh v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Materials { GpuMaterial v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Inputs { GpuInput v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Prims { GpuPrim v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer Attributes { GpuAttribute v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer SurfaceMaterials { GpuSurfaceMaterial v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Textures { GpuTexture v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer TexturePages { uint64_t v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer ConstUVec2s { uvec2 v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer LightingBlock { LightTablePointers l; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer LocalLights { GpuLocalLight v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer InfiniteLights { GpuInfiniteLight v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer LightNodes { GpuLightNode v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer LightKeys { GpuLightKey v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer MeshLights { GpuMeshLight v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer LightMeshes { GpuLightMesh v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer LightLeaves { GpuLightLeaf v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer LightTriangles { GpuLightTriangle v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer LightValues { GpuLightValue v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Shapings { GpuLightShaping v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer LightMaps { GpuLightMap v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Cdfs { GpuCdf v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer ConstVec3s { vec3 v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer ConstFloats { float v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer ConstUVec4s { uvec4 v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer ConstUints { uint v[]; };

layout(buffer_reference, scalar, buffer_reference_align = 16) buffer Vec4s { vec4 v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer UVec4s { uvec4 v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer Film { FilmPixel v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer ConstFilm { FilmPixel v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer ErrorParts { ErrorSums v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer ExactPixels { ExactPixel v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer PlaneSums { PlaneSum v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer IdSlots { IdSlot v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer DeepSlots { DeepSlot v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Vec3s { vec3 v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Floats { float v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Ints { int v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Uints { uint v[]; };

#endif
