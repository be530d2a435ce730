// What the server and the bench process tell each other: refused, or a message that is the same when it is
// sent again.
#include "input.h"
#include "server/bench/messages.h"

namespace {

using namespace ferrobench;

template <class M>
void look(const bench::Message& message) {
  const auto known = message.as<M>();
  const auto bytes = bench::encoded(known);
  fuzz::demand(bench::encoded(bench::decoded<M>(bytes)) == bytes, "the same when it is sent again");
  if constexpr (std::is_same_v<M, bench::Prepare>) {
    const auto waveform = known.program.waveform();
    fuzz::demand(waveform.pieces().size() == known.program.pieces.size(), "every piece");
  }
  if constexpr (std::is_same_v<M, bench::Reply>)
    if (known.failure) (void)known.failure->error();
}

template <class... M>
void look_at(const bench::Message& message) {
  ((message.kind == M::kind ? look<M>(message) : void()), ...);
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace bench;
  try {
    Inbox inbox;
    auto rest = fuzz::text_of(data, size);
    while (!rest.empty()) {
      inbox.add(rest.substr(0, 61));
      rest.remove_prefix(std::min<std::size_t>(rest.size(), 61));
      while (const auto message = inbox.next())
        look_at<Open, Look, Close, Selftest, StopSelftest, Prepare, Begin, Attend, Drop, Pause, Resume, Stop,
                Hasten, Leave, Alive, Ready, Reply, Status, Noted, Closed>(*message);
    }
  } catch (const Damaged&) {
  }
  return 0;
}
