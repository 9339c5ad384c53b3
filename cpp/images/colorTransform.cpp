// SPDX-License-Identifier: Apache-2.0
#include "images/colorConfig.h"
#include "images/imageLibrary.h"

#include <OpenColorIO/OpenColorIO.h>

#include <algorithm>
#include <cstdlib>
#include <stdexcept>
#include <sys/stat.h>
#include <vector>

namespace OCIO = OCIO_NAMESPACE;

namespace {

/// The names of linear Rec. 709, in the configurations of ACES and in others.
constexpr const char* targets[]
    = { "lin_rec709", "lin_rec709_scene", "lin_rec709_srgb", "Linear Rec.709 (sRGB)", "lin_srgb",
          "Utility - Linear - sRGB", "Utility - Linear - Rec.709", "Linear Rec.709", "Linear sRGB", "linear_srgb" };
/// Number of texels of one or two channels that are widened at a time.
constexpr std::size_t widened = 1024;

const OCIO::ConstConfigRcPtr& OwnConfig()
{
    static const OCIO::ConstConfigRcPtr config = HdOocPTMakeColorConfig();
    return config;
}

/// The user's configuration, from $OCIO; null without one.
OCIO::ConstConfigRcPtr UserConfig()
{
    const char* const path = std::getenv("OCIO");
    if (!path || !*path) {
        return nullptr;
    }
    // Opening a pipe would block. OpenColorIO reports missing files, and knows the names of its built-in
    // configurations.
    struct stat status
    {
    };
    if (stat(path, &status) == 0 && !S_ISREG(status.st_mode)) {
        throw std::runtime_error("needs the configuration that $OCIO names, which is no file");
    }
    return OCIO::Config::CreateFromEnv();
}

/// The conversion; null if the configuration does not have the color space.
OCIO::ConstProcessorRcPtr FindProcessor(const OCIO::ConstConfigRcPtr& config, const std::string& name)
{
    if (!config || !config->getColorSpace(name.c_str())) {
        return nullptr;
    }
    for (const char* const target : targets) {
        if (config->getColorSpace(target)) {
            return config->getProcessor(name.c_str(), target);
        }
    }
    return OCIO::Config::GetProcessorFromConfigs(config, name.c_str(), OwnConfig(), "lin_rec709");
}

class ColorTransform final : public HdOocPTColorTransform
{
public:
    explicit ColorTransform(const OCIO::ConstProcessorRcPtr& processor)
        // This optimization avoids the approximate powers of the default.
        : _processor(processor->getOptimizedCPUProcessor(OCIO::OPTIMIZATION_LOSSLESS))
    {
    }

    void Apply(float* texels, std::size_t count, std::uint32_t channels) const override
    {
        if (_processor->isNoOp() || count == 0) {
            return;
        }
        if (channels >= 3) {
            // A row of any length will do: each texel is converted by itself.
            OCIO::PackedImageDesc image(texels, static_cast<long>(count), 1, static_cast<long>(channels));
            _Apply(image, texels, count, channels);
            return;
        }
        std::vector<float> colors(3 * std::min(count, widened));
        for (std::size_t first = 0; first < count; first += widened) {
            const std::size_t part = std::min(widened, count - first);
            float* const grey = texels + first * channels;
            for (std::size_t i = 0; i < part; ++i) {
                std::fill_n(&colors[3 * i], 3, grey[i * channels]);
            }
            OCIO::PackedImageDesc image(colors.data(), static_cast<long>(part), 1, 3);
            _processor->apply(image);
            for (std::size_t i = 0; i < part; ++i) {
                grey[i * channels] = colors[3 * i];
            }
        }
    }

private:
    /// Converts texels; alpha stays, even if the conversion changes it.
    void _Apply(OCIO::PackedImageDesc& image, float* texels, std::size_t count, std::uint32_t channels) const
    {
        if (channels == 3) {
            _processor->apply(image);
            return;
        }
        std::vector<float> alpha(count);
        for (std::size_t i = 0; i < count; ++i) {
            alpha[i] = texels[i * channels + 3];
        }
        _processor->apply(image);
        for (std::size_t i = 0; i < count; ++i) {
            texels[i * channels + 3] = alpha[i];
        }
    }

    const OCIO::ConstCPUProcessorRcPtr _processor;
};

} // namespace

extern "C" __attribute__((visibility("default"))) std::unique_ptr<HdOocPTColorTransform> HdOocPTMakeColorTransform(
    const std::string& name)
{
    OCIO::SetLoggingLevel(OCIO::LOGGING_LEVEL_NONE);
    try {
        OCIO::ConstProcessorRcPtr processor = FindProcessor(UserConfig(), name);
        if (!processor) {
            processor = FindProcessor(OwnConfig(), name);
        }
        if (processor) {
            return std::make_unique<ColorTransform>(processor);
        }
    } catch (const OCIO::Exception& error) {
        throw std::runtime_error("the color space `" + name + "` cannot be converted: " + error.what());
    }
    throw std::runtime_error("the color space `" + name + "` is not known");
}
