// SPDX-License-Identifier: Apache-2.0
#include "images/imageFacts.h"

#include "images/imageKind.h"
#include "images/imageLimits.h"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <numeric>

namespace {

/// Number of levels of an image with 65536 texels a side.
constexpr int maxLevels = 17;
/// Texels of a tile above which reading a part of the file is not cheap. Ordinary tiles have 32 to 256 texels a side.
constexpr long maxTexelsOfPart = 1024L * 1024L;

/// 16-bit integers become floats: half precision would lose five of their bits.
HdOocPTTexelFormat FormatOf(OIIO::TypeDesc type)
{
    return type == OIIO::TypeDesc::UINT8 ? HdOocPTTexelFormat::UInt8
        : type == OIIO::TypeDesc::HALF   ? HdOocPTTexelFormat::Half
                                         : HdOocPTTexelFormat::Float;
}

HdOocPTImageWrap WrapOf(const std::string& word)
{
    return word == "black"   ? HdOocPTImageWrap::Black
        : word == "clamp"    ? HdOocPTImageWrap::Clamp
        : word == "periodic" ? HdOocPTImageWrap::Repeat
        : word == "mirror"   ? HdOocPTImageWrap::Mirror
                             : HdOocPTImageWrap::Unknown;
}

/// "diffuse" of "diffuse.R".
std::string LayerOf(const std::string& name)
{
    const std::size_t dot = name.rfind('.');
    return dot == std::string::npos ? "" : name.substr(0, dot);
}

/// The meaning of the channel within its layer: 'r', 'g', 'b', 'a', 'x', 'y' (luminance too), or 0.
char MeaningOf(const std::string& name)
{
    std::string word = name.substr(name.rfind('.') + 1);
    std::transform(word.begin(), word.end(), word.begin(), [](unsigned char c) { return std::tolower(c); });
    const bool isKnown = word == "red" || word == "green" || word == "blue" || word == "alpha"
        || (word.size() == 1 && std::string("rgbaxy").find(word) != std::string::npos);
    return isKnown ? word.front() : '\0';
}

} // namespace

OIIO::TypeDesc HdOocPTTypeOf(HdOocPTTexelFormat format)
{
    return format == HdOocPTTexelFormat::UInt8 ? OIIO::TypeDesc::UINT8
        : format == HdOocPTTexelFormat::Half   ? OIIO::TypeDesc::HALF
                                               : OIIO::TypeDesc::FLOAT;
}

std::vector<int> HdOocPTChooseChannels(const std::vector<std::string>& names)
{
    // The layer without a name comes first, the others in the order of the file.
    std::vector<std::string> layers { "" };
    for (const std::string& name : names) {
        if (std::find(layers.begin(), layers.end(), LayerOf(name)) == layers.end()) {
            layers.push_back(LayerOf(name));
        }
    }
    const auto find = [&](const std::string& layer, char meaning) {
        const auto found = std::find_if(names.begin(), names.end(),
            [&](const std::string& name) { return MeaningOf(name) == meaning && LayerOf(name) == layer; });
        return found == names.end() ? -1 : static_cast<int>(found - names.begin());
    };
    const auto withAlpha = [&](const std::string& layer, std::vector<int> chosen) {
        if (const int alpha = find(layer, 'a'); alpha >= 0) {
            chosen.push_back(alpha);
        }
        return chosen;
    };
    for (const std::string& layer : layers) {
        const std::vector<int> colors { find(layer, 'r'), find(layer, 'g'), find(layer, 'b') };
        if (*std::min_element(colors.begin(), colors.end()) >= 0) {
            return withAlpha(layer, colors);
        }
    }
    for (const std::string& layer : layers) {
        // The channel y is luminance here, not the second coordinate.
        if (const int luminance = find(layer, 'y'); luminance >= 0 && find(layer, 'x') < 0) {
            return withAlpha(layer, { luminance });
        }
    }
    std::vector<int> all(std::min<std::size_t>(names.size(), 4));
    std::iota(all.begin(), all.end(), 0);
    // Channels of further layers must not become green, blue or alpha of the first.
    const auto isOther = [&](int channel) { return LayerOf(names[channel]) != LayerOf(names.front()); };
    all.erase(std::remove_if(all.begin(), all.end(), isOther), all.end());
    return all;
}

HdOocPTImageFacts HdOocPTFindFacts(
    OIIO::ImageInput& input, const HdOocPTImageBytes& bytes, const std::vector<int>& channels)
{
    HdOocPTImageFacts facts;
    const OIIO::ImageSpec spec = input.spec(0, 0);
    const std::string name = input.format_name();
    facts.channels = static_cast<std::uint32_t>(channels.size());
    facts.format = FormatOf(spec.channelformat(channels.front()));
    for (const int channel : channels) {
        facts.format = std::max(facts.format, FormatOf(spec.channelformat(channel)));
    }
    facts.isTiled = spec.tile_width > 0 && static_cast<long>(spec.tile_width) * spec.tile_height <= maxTexelsOfPart;
    facts.isSrgb = name == "openexr" || name == "hdr" ? 0 : name == "png" ? HdOocPTFindPngColorSpace(bytes) : -1;
    const std::string wrap = spec.get_string_attribute("wrapmodes");
    const std::size_t comma = wrap.find(',');
    if (!wrap.empty()) {
        facts.wrap
            = { WrapOf(wrap.substr(0, comma)), WrapOf(comma == std::string::npos ? wrap : wrap.substr(comma + 1)) };
    }
    // Other formats have no levels, and return the same one for every number. (ImageInput::supports("mipmap") says no
    // for all.)
    const int most = name == "openexr" || name == "tiff" ? maxLevels : 1;
    for (int level = 0; level < most; ++level) {
        // spec_dimensions() returns something even for a level that does not exist.
        if (level > 0 && !input.seek_subimage(0, level)) {
            break;
        }
        const OIIO::ImageSpec found = level == 0 ? spec : input.spec_dimensions(0, level);
        // The levels of rip maps do not halve both sides.
        const bool isHalved
            = found.width == std::max(1, spec.width >> level) && found.height == std::max(1, spec.height >> level);
        if (found.undefined() || !isHalved || found.width < 1 || found.height < 1
            || found.nchannels != spec.nchannels) {
            break;
        }
        HdOocPTCheckSpec(level == 0 ? spec : found, name, bytes.GetSize());
        facts.levels.push_back({ static_cast<std::uint32_t>(found.width), static_cast<std::uint32_t>(found.height) });
    }
    // Asking for a level that does not exist leaves an error message behind.
    static_cast<void>(input.geterror());
    return facts;
}
