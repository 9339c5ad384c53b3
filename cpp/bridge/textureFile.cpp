// SPDX-License-Identifier: Apache-2.0
/// The function for programs that load the plugin without rendering: plugin/texture-host calls it for `oocpt texture`.
#include "bridge/imageSource.h"
#include "oocpt-bridge/src/lib.rs.h"
#include "pxr/usd/ar/resolvedPath.h"
#include "pxr/usd/ar/resolver.h"

#include <exception>
#include <string>

PXR_NAMESPACE_USING_DIRECTIVE

/// Inspects a texture file (`info`) or puts it into the texture cache (`convert`). `path` is an asset path, resolved by
/// the host's resolver; a path that it does not resolve is used as it is. The answer is a JSON object, which has only
/// the member `error` if the call failed; it is valid until this thread's next call. Any thread, several at once.
extern "C" __attribute__((visibility("default"))) const char* HdOocPTTextureFile(
    const char* command, const char* path, const char* colorSpace)
{
    thread_local std::string answer;
    try {
        const ArResolvedPath resolved = ArGetResolver().Resolve(path);
        const std::string found = resolved.empty() ? std::string(path) : resolved.GetPathString();
        answer = std::string(oocpt::texture_file(HdOocPTMakeImageSource(), command, found, colorSpace));
    } catch (const std::exception& error) {
        // Texts of panics hold only our own words; a quote would end the string.
        std::string text(error.what());
        for (char& letter : text) {
            if (letter == '"' || letter == '\\' || static_cast<unsigned char>(letter) < 0x20) {
                letter = ' ';
            }
        }
        answer = "{\"error\": \"" + text + "\"}";
    }
    return answer.c_str();
}
