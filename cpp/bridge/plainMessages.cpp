// SPDX-License-Identifier: Apache-2.0
#include "bridge/plainMessages.h"

#include "pxr/base/tf/diagnosticMgr.h"
#include "pxr/base/tf/error.h"
#include "pxr/base/tf/status.h"
#include "pxr/base/tf/stringUtils.h"
#include "pxr/base/tf/warning.h"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

/// The text without line ends and other control characters; blanks beside a line end go with it.
std::string _OneLine(const std::string& text)
{
    std::string line;
    for (const std::string& part : TfStringSplit(text, "\n")) {
        const std::string trimmed = TfStringTrim(part);
        if (!trimmed.empty()) {
            line += (line.empty() ? "" : " ") + trimmed;
        }
    }
    for (char& letter : line) {
        if (static_cast<unsigned char>(letter) < 0x20 || letter == 0x7f) {
            letter = ' ';
        }
    }
    return line;
}

/// Our own texts already begin with our name. The kind of message is left out for our own status.
void _Print(const char* kind, const std::string& text)
{
    static const std::string ours = "OocPT: ";
    const bool isOurs = TfStringStartsWith(text, ours);
    const bool isStatus = std::strcmp(kind, "status") == 0;
    const std::string line = std::string(isOurs ? "OocPT: " : "USD: ")
        + (isOurs && isStatus ? "" : std::string(kind) + ": ") + _OneLine(isOurs ? text.substr(ours.size()) : text)
        + "\n";
    // One call writes the line, so that lines of several threads do not mix.
    std::fwrite(line.data(), 1, line.size(), stderr);
    std::fflush(stderr);
}

/// Returns true for what FrameRecorder says of products: it looks for files by names with placeholders, and expects
/// products of all render settings. The renderer says what it has written, and what not.
bool _IsAboutProducts(const std::string& text)
{
    return TfStringStartsWith(text, "Missing generated Product ") || TfStringStartsWith(text, "Product '")
        || TfStringStartsWith(text, "No Render Prouducts found");
}

class _PlainMessages final : public TfDiagnosticMgr::Delegate
{
public:
    void IssueError(const TfError& error) override { _Print("error", error.GetCommentary()); }

    void IssueFatalError(const TfCallContext& context, const std::string& text) override
    {
        // An error in the program: its place in the source is worth printing.
        _Print("fatal error",
            text + TfStringPrintf(" (%s, %s:%zu)", context.GetFunction(), context.GetFile(), context.GetLine()));
        std::abort();
    }

    void IssueStatus(const TfStatus& status) override
    {
        if (!_IsAboutProducts(status.GetCommentary())) {
            _Print("status", status.GetCommentary());
        }
    }

    void IssueWarning(const TfWarning& warning) override
    {
        if (!_IsAboutProducts(warning.GetCommentary())) {
            _Print("warning", warning.GetCommentary());
        }
    }
};

} // namespace

void HdOocPTPrintPlainMessages()
{
    // The delegate is never removed: the host prints until the process ends.
    TfDiagnosticMgr::GetInstance().AddDelegate(new _PlainMessages);
}

PXR_NAMESPACE_CLOSE_SCOPE
