// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_TOKENS_H
#define HDOOCPT_SCENE_TOKENS_H

#include "pxr/base/tf/staticTokens.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// Names of the scene index prims and data sources that OocPT reads. They are spelled out here, and not taken from
/// Hydra's schema classes, so that the same source builds against every host.
// clang-format off
#define HDOOCPT_SCENE_TOKENS                                                                                          \
    /* prim types */                                                                                                  \
    (mesh)(instancer)(domeLight)(distantLight)(simpleLight)(rectLight)(sphereLight)(diskLight)(cylinderLight)         \
    (geomSubset)(renderSettings)(tetMesh)(nurbsPatch)(nurbsCurves)                                                    \
    /* every prim */                                                                                                  \
    (xform)(matrix)(visibility)(purpose)(instancedBy)(paths)(prototypeRoots)                                          \
    /* meshes */                                                                                                      \
    (topology)(faceVertexCounts)(faceVertexIndices)(holeIndices)(orientation)(leftHanded)(subdivisionScheme)          \
    (catmullClark)(loop)(bilinear)(subdivisionTags)(interpolateBoundary)(faceVaryingLinearInterpolation)              \
    (triangleSubdivisionRule)(creaseIndices)(creaseLengths)(creaseSharpnesses)(cornerIndices)(cornerSharpnesses)      \
    (none)(edgeOnly)(edgeAndCorner)(cornersOnly)(cornersPlus1)(cornersPlus2)(boundaries)(all)(smooth)                 \
    /* curves that stand for models */                                                                                \
    (boundsCurves)(originCurves)((usdPrimInfo, "__usdPrimInfo"))                                                      \
    /* curves, points, solids of revolution */                                                                        \
    (basisCurves)(curveVertexCounts)(curveIndices)(basis)(wrap)(linear)(cubic)(bezier)(bspline)(catmullRom)           \
    (nonperiodic)(periodic)(pinned)(segmented)(widths)(sphere)(capsule)(cylinder)(cone)(axis)((axisX, "X"))           \
    ((axisY, "Y"))((axisZ, "Z"))(radiusTop)(radiusBottom)                                                             \
    (displayStyle)(refineLevel)(doubleSided)(type)(typeFaceSet)(categories)(instanceCategories)(collections)       \
    (membershipExpression)(instanceLocations)(categoriesValues)                                                       \
    /* bindings */                                                                                                    \
    (materialBindings)(path)(full)((allPurpose, ""))                                                                  \
    /* materials */                                                                                                   \
    ((universal, ""))(mtlx)(nodes)(parameters)(value)(colorSpace)(inputConnections)(upstreamNodePath)                 \
    (upstreamNodeOutputName)(nodeIdentifier)(terminals)(surface)(displacement)(volume)(nodeTypeInfo)                  \
    ((mtlxSourceAsset, "mtlx:sourceAsset"))((mtlxSubIdentifier, "mtlx:sourceAsset:subIdentifier"))                    \
    /* primvars */                                                                                                    \
    (primvars)(primvarValue)(indexedPrimvarValue)(indices)(interpolation)(extComputationPrimvars)(points)(normals)    \
    (displayColor)(displayOpacity)(constant)(uniform)(varying)(vertex)(faceVarying)(instance)                         \
    ((displayColorProperty, "primvars:displayColor"))((displayOpacityProperty, "primvars:displayOpacity"))            \
    /* the whole scene */                                                                                             \
    (system)(assetResolution)(resolverContext)                                                                        \
    /* prims of legacy front ends */                                                                                  \
    (sceneDelegate)                                                                                                   \
    /* instancers */                                                                                                  \
    (instancerTopology)(prototypes)(instanceIndices)(mask)((instanceTranslations, "hydra:instanceTranslations"))      \
    ((instanceRotations, "hydra:instanceRotations"))((instanceScales, "hydra:instanceScales"))                        \
    ((instanceTransforms, "hydra:instanceTransforms"))                                                                \
    /* lights */                                                                                                      \
    (light)(material)(color)(intensity)(exposure)(enableColorTemperature)(colorTemperature)(normalize)(angle)         \
    (diffuse)(specular)(width)(height)(radius)(length)(treatAsPoint)(treatAsLine)(lightLink)(shadowLink)(filters)     \
    (portals)(isLight)(materialSyncMode)(independent)(noMaterialResponse)(meshLight)(domeOffset)                      \
    ((textureFile, "texture:file"))((textureFormat, "texture:format"))((shadowEnable, "shadow:enable"))               \
    ((shadowColor, "shadow:color"))((coneAngle, "shaping:cone:angle"))((coneSoftness, "shaping:cone:softness"))       \
    ((shapingFocus, "shaping:focus"))((focusTint, "shaping:focusTint"))((iesFile, "shaping:ies:file"))                \
    ((iesAngleScale, "shaping:ies:angleScale"))((iesNormalize, "shaping:ies:normalize"))                              \
    ((shadowDistance, "shadow:distance"))((shadowFalloff, "shadow:falloff"))                                           \
    ((shadowFalloffGamma, "shadow:falloffGamma"))                                                                     \
    ((cameraVisibility, "ri:attributes:visibility:camera"))((authoredConeAngle, "inputs:shaping:cone:angle"))         \
    ((authoredConeSoftness, "inputs:shaping:cone:softness"))                                                          \
    /* cameras */                                                                                                     \
    (camera)(focalLength)(fStop)(focusDistance)(projection)(orthographic)(shutterOpen)(shutterClose)                  \
    ((shutterOpenAttribute, "shutter:open"))((shutterCloseAttribute, "shutter:close"))(clippingPlanes)                \
    (linearExposureScale)(exposureTime)(exposureIso)(exposureFStop)(exposureResponsivity)                             \
    /* motion */                                                                                                      \
    (velocities)(accelerations)(angularVelocities)(timeCodesPerSecond)(startTimeCode)(primaryCameraPrim)              \
    (disableMotionBlur)(instantaneousShutter)(motion)(renderProducts)(disableDepthOfField)                            \
    /* render settings */                                                                                             \
    (namespacedSettings)(active)(sceneGlobals)(activeRenderSettingsPrim)(includedPurposes)(materialBindingPurposes)   \
    (renderingColorSpace)(lin_rec709)(lin_rec709_scene)(dataWindowNDC)                                                               \
    ((usdRenderSettings, "__usdRenderSettings"))((usdRenderProduct, "__usdRenderProduct"))                            \
    ((usdRenderVar, "__usdRenderVar"))                                                                                \
    /* purposes and render tags */                                                                                    \
    (geometry)((defaultPurpose, "default"))(render)(proxy)(guide)

/// Names of render products and their views: a list of tokens holds 256 at most.
#define HDOOCPT_PRODUCT_TOKENS                                                                                        \
    (path)(type)(name)(resolution)(renderVars)(cameraPrim)(pixelAspectRatio)(aspectRatioConformPolicy)(dataWindowNDC) \
    (disableDepthOfField)(namespacedSettings)(dataType)(sourceName)(sourceType)(expandAperture)(cropAperture)         \
    (adjustApertureWidth)(adjustApertureHeight)(adjustPixelAspectRatio)(currentFrame)(focalLength)(projection)        \
    (horizontalAperture)(verticalAperture)(horizontalApertureOffset)(verticalApertureOffset)(clippingRange)

/// Names of the label that lights and surfaces have in light path expressions: OocPT's own, then those of RenderMan,
/// Karma and Arnold.
#define HDOOCPT_LABEL_TOKENS                                                                                          \
    ((lightGroup, "oocpt:lightGroup"))((riLightGroup, "ri:light:lightGroup"))                                         \
    ((riGroup, "ri:attributes:identifier:lpegroup"))((karmaLightTag, "karma:light:lpetag"))                           \
    ((karmaObjectTag, "karma:object:lpetag"))((arnoldAov, "arnold:aov"))

/// Names of render passes.
#define HDOOCPT_PASS_TOKENS (activeRenderPassPrim)(renderVisibility)(cameraVisibility)(matte)(prune)
// clang-format on

TF_DECLARE_PUBLIC_TOKENS(HdOocPTSceneTokens, HDOOCPT_SCENE_TOKENS);
TF_DECLARE_PUBLIC_TOKENS(HdOocPTProductTokens, HDOOCPT_PRODUCT_TOKENS);
TF_DECLARE_PUBLIC_TOKENS(HdOocPTLabelTokens, HDOOCPT_LABEL_TOKENS);
TF_DECLARE_PUBLIC_TOKENS(HdOocPTPassTokens, HDOOCPT_PASS_TOKENS);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
