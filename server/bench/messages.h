// What the server and the bench process tell each other.
//
// A message is a head of 12 bytes and its payload (codec.h):
//
//   magic "FBBP" | version (2 bytes) | kind (2) | bytes of payload (4)
//
// The server asks with a number, `call`, and the reply has the same one; 0 is for who does not wait for it.
// Status, events and the end of a run come by themselves. Both sides say `alive` again and again.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "daq/device_facts.h"
#include "daq/guard/feed.h"
#include "daq/guard/guard.h"
#include "daq/guard/limits.h"
#include "daq/selftest.h"
#include "protocols/waveform.h"
#include "server/bench/codec.h"

namespace ferrobench::bench {

inline constexpr std::uint16_t version =
    4;  // 2: a past has a degree of poling; 3: a piece its sampling; 4: how it is recorded
inline constexpr std::size_t head_bytes = 12;
inline constexpr std::uint32_t most_payload = 1u << 30;  // a program of 10^8 samples

enum class Kind : std::uint16_t {
  open = 1,
  look,
  close,
  selftest,
  stop_selftest,
  prepare,
  begin,
  attend,
  drop,
  pause,
  resume,
  stop,
  hasten,
  leave,
  alive,
  ready,
  reply,
  status,
  event,
  closed
};

// ---- from the server ----

struct Open {  // reply: DeviceFacts; the device has this number then
  static constexpr Kind kind = Kind::open;
  std::uint64_t call = 0;
  std::uint32_t device = 0;
  std::string driver{};
  nlohmann::json config{};  // checked by the server; read once, before anything is armed
};
struct Look {  // reply: DeviceFacts
  static constexpr Kind kind = Kind::look;
  std::uint64_t call = 0;
  std::uint32_t device = 0;
};
struct Close {  // brings its output to zero first; reply: nothing
  static constexpr Kind kind = Kind::close;
  std::uint64_t call = 0;
  std::uint32_t device = 0;
  double slew = 0;  // V/m/s
};
struct Selftest {  // reply: daq::SelftestReport
  static constexpr Kind kind = Kind::selftest;
  std::uint64_t call = 0;
  std::uint32_t device = 0;
  double rate = 0;  // Hz
};
struct StopSelftest {  // of any device
  static constexpr Kind kind = Kind::stop_selftest;
  std::string reason{};
};

// A waveform in its parts. Throws Damaged if they are none.
struct Program {
  std::vector<protocols::Piece> pieces{};
  std::vector<protocols::Segment> segments{};
  protocols::LevelUnit unit{};

  static Program of(const protocols::Waveform& waveform);
  protocols::Waveform waveform() const;
};

struct Prepare {  // checks it all, moves nothing; reply: Prepared
  static constexpr Kind kind = Kind::prepare;
  std::uint64_t call = 0;
  std::uint32_t run = 0;  // its number
  std::uint32_t device = 0;
  bool last_use = false;   // the device is closed when the run is over
  bool real_time = false;  // it does not wait for the disk
  double rate = 0;         // Hz, asked for, of segments that ask for none
  bool exact_rate = false;
  daq::Limits limits{};
  Program program{};
};
struct Prepared {
  double rate = 0;        // Hz
  double distortion = 0;  // s
  std::uint64_t size = 0;
  double first_level = 0;  // V/m
  double stop_slew = 0;    // V/m/s
  daq::DeviceFacts facts{};
};
// Goes on with a journal that the server has begun: its open file comes with this message, and with it its
// lock. No reply: the run's status says how it goes.
struct Begin {
  static constexpr Kind kind = Kind::begin;
  std::uint32_t run = 0;
  std::string path{};        // of the journal
  std::string start_time{};  // as in the journal
  std::vector<recordings::Event> events{};
  bool unattended = false;  // goes on to its end without a server
  std::string folder{};     // where a bench without a server listens for the next one; "": nowhere
  std::string card{};       // what that one needs to know; the bench process does not read it
};
struct Attend {  // the server that took over is ready to hear of the run
  static constexpr Kind kind = Kind::attend;
  std::uint32_t run = 0;
};
struct Drop {  // it is over, or never began
  static constexpr Kind kind = Kind::drop;
  std::uint32_t run = 0;
};
struct Pause {  // as Guard's; each of the four has the run's status as a message, then a reply that says
                // nothing
  static constexpr Kind kind = Kind::pause;
  std::uint64_t call = 0;
  std::uint32_t run = 0;
};
struct Resume {
  static constexpr Kind kind = Kind::resume;
  std::uint64_t call = 0;
  std::uint32_t run = 0;
};
struct Stop {
  static constexpr Kind kind = Kind::stop;
  std::uint64_t call = 0;
  std::uint32_t run = 0;
  std::string reason{};
};
struct Hasten {
  static constexpr Kind kind = Kind::hasten;
  std::uint64_t call = 0;
  std::uint32_t run = 0;
};
struct Leave {  // ends what is under way, closes the devices and ends the bench process
  static constexpr Kind kind = Kind::leave;
};

struct Alive {
  static constexpr Kind kind = Kind::alive;
};

// ---- from the bench process ----

struct Ready {  // the first message; with the open journal of a run that is taken over
  static constexpr Kind kind = Kind::ready;
  std::int64_t process = 0;
  std::string lacks{};    // of memory locks and priority, "" if it has both
  std::uint32_t run = 0;  // that is taken over; 0: none
  std::string card{};     // of that run
};

// An Error of the bench process.
struct Failure {
  ErrorCode code{};
  std::string message{};
  nlohmann::json problems{};

  static Failure of(const std::exception& error);
  Error error() const;
};
struct Reply {
  static constexpr Kind kind = Kind::reply;
  std::uint64_t call = 0;
  std::optional<Failure> failure{};
  std::string body{};  // the encoded answer
};

// Blocks between device and disk, of 0.1 s each in real time.
inline constexpr std::size_t queue_blocks = 256;
struct RunState {
  daq::Progress::State guard{};
  daq::End end{};
  bool output_at_zero = false;
  std::uint64_t rows = 0, rows_expected = 0, rows_on_disk = 0;
  std::uint32_t blocks_waiting = 0, most_waiting = 0;  // between device and disk
  std::string reason{}, warning{};
};
struct Status {
  static constexpr Kind kind = Kind::status;
  std::uint32_t run = 0;
  RunState state{};
};
struct Noted {
  static constexpr Kind kind = Kind::event;
  std::uint32_t run = 0;
  std::uint64_t missed = 0;  // events before this one that the server did not take in time
  recordings::Event event{};
};
// The journal is closed and the device let go.
struct Closed {
  static constexpr Kind kind = Kind::closed;
  std::uint32_t run = 0;
  RunState state{};
  std::string ending{};    // of the journal, as text
  std::string failure{};   // to write it, "" if all went well
  std::uint64_t rows = 0;  // in the journal
  std::vector<recordings::SegmentRow> played{};
};

std::string frame(Kind kind, std::string_view payload);

template <class M>
std::string encoded(const M& message) {
  Encoder out;
  out(message);
  return out.take();
}
template <class M>
std::string framed(const M& message) {
  return frame(M::kind, encoded(message));
}
// Throws Damaged.
template <class M>
M decoded(std::string_view bytes) {
  M out;
  Decoder in(bytes);
  in(out);
  in.finish();
  return out;
}

struct Message {
  Kind kind{};
  std::string payload{};
  template <class M>
  M as() const {
    return decoded<M>(payload);
  }
};

// Cuts what comes in any pieces into messages.
class Inbox {
 public:
  void add(std::string_view bytes) { bytes_ += bytes; }
  // The next whole one. Throws Damaged: another program or another version speaks, or it is too long.
  std::optional<Message> next();

 private:
  std::string bytes_;
  std::size_t taken_ = 0;
};

}  // namespace ferrobench::bench

#include "server/bench/message_fields.h"  // IWYU pragma: export
