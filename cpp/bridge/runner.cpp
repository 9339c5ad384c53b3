// SPDX-License-Identifier: Apache-2.0
/// What command lines of ours ask of the plugin that they have loaded (plugin/usdrecord, plugin/texture-host): to hear
/// interrupts while Python is blocked in the host, and to print diagnostics as plain lines. No other host calls this,
/// and nothing here installs a signal handler: the command line's own writes a byte into a pipe.
#include "bridge/plainMessages.h"
#include "oocpt-bridge/src/ffi_runner.rs.h"
#include "scene/timeCodes.h"

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <exception>
#include <string>
#include <system_error>
#include <thread>

#include <unistd.h>

PXR_NAMESPACE_USING_DIRECTIVE

namespace {

/// As shells say of a program that was interrupted.
constexpr int INTERRUPTED = 130;

/// Returns true if there is a picture to wait for.
bool _Interrupt() noexcept
{
    try {
        return oocpt::interrupt();
    } catch (const std::exception&) {
        return false;
    }
}

/// Runs until the other end is closed. Bytes that are no such signal mean nothing.
void _Listen(int descriptor)
{
    for (;;) {
        unsigned char signal = 0;
        const ssize_t count = read(descriptor, &signal, 1);
        if (count < 0 && errno == EINTR) {
            continue;
        }
        if (count != 1) {
            return;
        }
        if ((signal == SIGINT || signal == SIGTERM) && !_Interrupt()) {
            _exit(INTERRUPTED);
        }
    }
}

template <typename Function>
bool _Try(Function&& function) noexcept
{
    try {
        return function();
    } catch (const std::exception&) {
        return false;
    }
}

} // namespace

/// From now on diagnostics of the host are plain lines on standard error, and each byte SIGINT or SIGTERM that is read
/// from `descriptor` is an interrupt: the process ends at once with status 130, unless there is a picture to wait for.
/// Returns whether somebody listens. Call it once.
extern "C" __attribute__((visibility("default"))) int HdOocPTRunnerStart(int descriptor)
{
    return _Try([descriptor] {
        HdOocPTPrintPlainMessages();
        std::thread(_Listen, descriptor).detach();
        return true;
    });
}

/// A picture is begun, whose temporary files are in `folder`, to be removed when the process ends before it is written.
/// Returns 0 when there was an interrupt before: the picture is not to be begun.
extern "C" __attribute__((visibility("default"))) int HdOocPTRunnerBegin(const char* folder)
{
    return _Try([folder] { return oocpt::begin_picture(rust::Str(folder)); });
}

/// Sets a setting for what is rendered from now on, above what scene, host and environment say. `name` is a key,
/// with or without `oocpt:` in front. Returns 0 and writes why to `message` (of `size` bytes, cut and ended with a
/// zero byte) when there is no such setting, or it does not take the value.
extern "C" __attribute__((visibility("default"))) int HdOocPTRunnerSet(
    const char* name, const char* value, char* message, size_t size)
{
    try {
        oocpt::set_on_command_line(rust::Str(name), rust::Str(value));
        return 1;
    } catch (const std::exception& error) {
        if (size > 0) {
            std::snprintf(message, size, "%s", error.what());
        }
        return 0;
    }
}

/// Of the stage of this process: scenes that come by a front end that does not say it have so many time codes a second.
extern "C" __attribute__((visibility("default"))) void HdOocPTRunnerTimeCodesPerSecond(double rate)
{
    HdOocPTSetTimeCodesPerSecond(rate);
}

/// The picture that was begun is rendered: the first interrupt now waits until it is written.
extern "C" __attribute__((visibility("default"))) void HdOocPTRunnerRendered()
{
    _Try([] {
        oocpt::picture_rendered();
        return true;
    });
}

/// Whether there was an interrupt; then also how far the picture that was begun is: samples of each pixel that are
/// done, 0 for none, and how many were asked for.
extern "C" __attribute__((visibility("default"))) int HdOocPTRunnerInterrupted(
    unsigned int* samples, unsigned int* target)
{
    return _Try([samples, target] {
        const oocpt::Interrupted state = oocpt::interrupted();
        *samples = state.samples;
        *target = state.target;
        return state.is_interrupted;
    });
}
