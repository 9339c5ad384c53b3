// SPDX-License-Identifier: Apache-2.0
/// The functions that our command lines call in the plugin that they have loaded (plugin/usdrecord,
/// plugin/texture-host): to handle interrupts while Python is blocked in the host, and to print diagnostics as plain
/// lines. No other host calls them, and nothing here installs a signal handler: the command line's own writes a byte
/// into a pipe.
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

/// The exit status that shells report for an interrupted program.
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

void _MakeCheckpoint() noexcept
{
    try {
        oocpt::make_checkpoint();
    } catch (const std::exception&) {
        // It was logged where it arose; the picture goes on.
    }
}

/// Reads until the other end is closed. Bytes that are no signal of these three are ignored.
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
        if (signal == SIGUSR1) {
            _MakeCheckpoint();
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

/// Prints diagnostics of the host as plain lines on standard error from now on, and takes each byte SIGINT or SIGTERM
/// that is read from `descriptor` as an interrupt: the process ends at once with status 130, unless there is a picture
/// to wait for. A byte SIGUSR1 has a checkpoint made (`oocpt:checkpoint`). Returns 1 if a thread listens, else 0. Call
/// it once.
extern "C" __attribute__((visibility("default"))) int HdOocPTRunnerStart(int descriptor)
{
    return _Try([descriptor] {
        HdOocPTPrintPlainMessages();
        std::thread(_Listen, descriptor).detach();
        return true;
    });
}

/// Begins a picture, whose temporary files are in `folder`, to be removed if the process ends before it is written.
/// Returns 0 if there was an interrupt before: the picture must not be begun.
extern "C" __attribute__((visibility("default"))) int HdOocPTRunnerBegin(const char* folder)
{
    return _Try([folder] { return oocpt::begin_picture(rust::Str(folder)); });
}

/// Sets a setting for everything rendered from now on, overriding scene, host and environment. `name` is a key, with or
/// without `oocpt:` in front. Returns 0 and writes the reason to `message` (of `size` bytes, cut and ended with a zero
/// byte) if there is no such setting, or it does not take the value.
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

/// Returns 1 if there is an AOV of that name, else 0 and writes what is wrong to `message`, as HdOocPTRunnerSet().
extern "C" __attribute__((visibility("default"))) int HdOocPTRunnerAov(const char* name, char* message, size_t size)
{
    return _Try([&] {
        const std::string wrong(oocpt::unknown_aov(rust::Str(name)));
        if (size > 0) {
            std::snprintf(message, size, "%s", wrong.c_str());
        }
        return wrong.empty();
    });
}

/// Sets the time codes per second of the stage of this process, for scenes whose front end does not tell them.
extern "C" __attribute__((visibility("default"))) void HdOocPTRunnerTimeCodesPerSecond(double rate)
{
    HdOocPTSetTimeCodesPerSecond(rate);
}

/// Notes that the begun picture is rendered: the first interrupt now waits until it is written.
extern "C" __attribute__((visibility("default"))) void HdOocPTRunnerRendered()
{
    _Try([] {
        oocpt::picture_rendered();
        return true;
    });
}

/// Adds to the EXR file `path`, to which the host has written the begun picture, how it was made. Returns 0 if the file
/// stays as it is.
extern "C" __attribute__((visibility("default"))) int HdOocPTRunnerAnnotate(const char* path)
{
    return _Try([path] {
        oocpt::annotate_picture(rust::Str(path));
        return true;
    });
}

/// Returns 1 if there was an interrupt; then also the progress of the begun picture: the finished samples of each
/// pixel, 0 for none, and the requested number.
extern "C" __attribute__((visibility("default"))) int HdOocPTRunnerInterrupted(
    unsigned int* samples, unsigned int* target)
{
    return _Try([samples, target] {
        const oocpt::InterruptState state = oocpt::interrupted();
        *samples = state.samples;
        *target = state.target;
        return state.is_interrupted;
    });
}
