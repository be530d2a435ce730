#include "server/bench/process.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <csignal>
#include <system_error>

#include "daq/usb/usb_device.h"
#include "daq/virtual/virtual_device.h"
#include "recordings/process/child.h"
#include "server/bench/host.h"
#include "server/bench/priority.h"

namespace ferrobench::bench {

namespace {

constexpr std::string_view process_name = "ferrobench: holds the voltage";

// Those that are played by a bench process. A replay reads a file, and holds no voltage.
std::unique_ptr<daq::Device> open_device(const std::string& driver, const nlohmann::json& config) {
  if (driver == "usb") {
    go_first();  // opening brings an output to zero, and the driver's threads begin here
    return daq::usb::UsbDevice::open(config);
  }
  if (driver == "virtual") return daq::VirtualDevice::open(config);
  throw Error(ErrorCode::not_found, "the bench process has no such device",
              Problem{.path = "/device", .given = driver, .allowed = {"usb", "virtual"}});
}

std::string join(const std::string& a, const std::string& b) {
  return a + (a.empty() || b.empty() ? "" : "; ") + b;
}

[[noreturn]] void hold_the_voltage() {
  prctl(PR_SET_NAME, "ferrobench-hold");
  // When it ends is decided by its server and by its runs.
  for (const int number : {SIGTERM, SIGINT, SIGHUP, SIGPIPE}) (void)std::signal(number, SIG_IGN);
  Descriptor server(fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, STDERR_FILENO + 1));
  const Descriptor nothing(open("/dev/null", O_RDONLY | O_CLOEXEC));
  dup2(nothing.get(), STDIN_FILENO);
  const auto lacks = join(lock_memory(), go_first_alone());
  Host(std::move(server), open_device, true, lacks).serve();
  _exit(EXIT_SUCCESS);
}

// Before main(), so that it works in whatever program this library is part of.
[[gnu::constructor]] void hold_if_asked(int argc, char** argv) {
  if (argc == 1 && argv[0] == process_name) hold_the_voltage();
}

}  // namespace

Process start_process() {
  std::array<int, 2> ends{-1, -1};
  const auto fail = [](const std::string& why) {
    throw Error(ErrorCode::device_unavailable, "the process of the bench cannot be started",
                Problem{.message = why, .hint = "see how many processes and open files are allowed"});
  };
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
    fail(std::generic_category().message(errno));
  Process out{.socket = Descriptor(ends[0])};
  const Descriptor other(ends[1]);
  const Descriptor given(fcntl(other.get(), F_DUPFD_CLOEXEC, STDERR_FILENO + 1));
  try {
    out.number = recordings::start_apart(std::string(process_name), given.get(), first_priority);
  } catch (const std::system_error& failure) {
    fail(failure.code().message());
  }
  return out;
}

}  // namespace ferrobench::bench
