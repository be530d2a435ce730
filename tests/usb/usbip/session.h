// One USB/IP connection as a machine of bytes: what has come in, what is to go out. No socket in here.
//
// A connection begins with OP_REQ_DEVLIST, which ends it, or OP_REQ_IMPORT, after which transfers come and
// go. Whatever does not fit the protocol closes it.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "host/emulator.h"
#include "usbip/wire.h"

namespace ferrobench::emulator::usbip {

inline constexpr std::string_view bus_id = "1-1";
inline constexpr std::uint32_t device_id = 1U << 16 | 2;  // bus and device number

class Session {
 public:
  static constexpr std::size_t most_bytes = std::size_t{1} << 20;  // of a transfer
  static constexpr std::size_t most_transfers = 1024;              // under way at once

  explicit Session(Port& port) : port_(port) {}
  ~Session() { port_.cancel_all(); }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  void receive(std::span<const std::byte> bytes);
  // Answers to what the port has finished.
  void collect();
  std::vector<std::byte> take_output() { return std::exchange(out_, {}); }
  bool closed() const { return closed_; }  // after its output has gone

 private:
  bool operation();  // false: more bytes are needed
  bool command();
  void submit(const Header& header, std::span<const std::byte> data);
  void unlink(const Header& header);
  void answer(std::uint32_t sequence, int status, std::size_t length, std::span<const std::byte> data);
  void send(std::span<const std::byte> bytes) { out_.insert(out_.end(), bytes.begin(), bytes.end()); }
  void describe_device(Writer& out, bool with_interfaces) const;

  Port& port_;
  std::vector<std::byte> in_, out_;
  std::set<std::uint32_t> under_way_;  // sequence numbers
  bool imported_ = false, closed_ = false;
  unsigned departures_ = 0;  // of the unit, when it was imported
};

}  // namespace ferrobench::emulator::usbip
