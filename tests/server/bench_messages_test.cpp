// What server and bench process tell each other comes as it was sent, or is refused.
#include "tests/server/bench_messages.h"

#include <gtest/gtest.h>
#include <sys/socket.h>

#include <random>

#include "server/bench/channel.h"

namespace ferrobench::bench {
namespace {

// Decodes whatever it is; what it was is encoded again.
std::string again(const Message& m) {
  switch (m.kind) {
    case Kind::open:
      return framed(m.as<Open>());
    case Kind::prepare:
      return framed(m.as<Prepare>());
    case Kind::begin:
      return framed(m.as<Begin>());
    case Kind::stop:
      return framed(m.as<Stop>());
    case Kind::ready:
      return framed(m.as<Ready>());
    case Kind::reply:
      return framed(m.as<Reply>());
    case Kind::status:
      return framed(m.as<Status>());
    case Kind::event:
      return framed(m.as<Noted>());
    case Kind::closed:
      return framed(m.as<Closed>());
    default:
      return {};
  }
}

TEST(BenchMessages, ComeAsTheyWereInPiecesOfAnySize) {
  std::string all;
  for (const auto& frame : frames()) all += frame;
  for (const std::size_t piece : {std::size_t{1}, std::size_t{13}, all.size()}) {
    Inbox inbox;
    std::string came;
    for (std::size_t at = 0; at < all.size(); at += piece) {
      inbox.add(std::string_view(all).substr(at, piece));
      while (const auto message = inbox.next()) came += again(*message);
    }
    EXPECT_EQ(came, all) << piece;
  }
}

TEST(BenchMessages, CarryWhatWasPutIn) {
  const auto back = decoded<Prepare>(encoded(prepare()));
  EXPECT_EQ(back.limits.stop_slew, 3e5);
  EXPECT_EQ(back.limits.field_max, 1.5e6);
  const auto waveform = back.program.waveform();
  EXPECT_EQ(waveform.value(1), 0.5e6);
  EXPECT_EQ(waveform.unit().name, "kV/mm");
  EXPECT_EQ(waveform.segments()[0].label, "up");
  EXPECT_EQ(waveform.sampling(), 200);
  EXPECT_EQ(waveform.pieces()[0].recorded.rate, 400);
  EXPECT_EQ(waveform.pieces()[0].recorded.per_decade, 30);
  const auto known = decoded<daq::DeviceFacts>(encoded(facts()));
  EXPECT_EQ(known.info, facts().info);
  EXPECT_EQ(known.past, facts().past);
  EXPECT_EQ(known.noise, facts().noise);
  EXPECT_EQ(known.specimen->layer_count, 180);
  const auto failure = decoded<Reply>(encoded(Reply{
      .failure = Failure::of(Error(ErrorCode::device_lost, "gone",
                                   Problem{.path = "/x", .given = 1, .allowed = {1, 2}, .unit = "V"}))}));
  const auto error = failure.failure->error();
  EXPECT_EQ(error.code(), ErrorCode::device_lost);
  EXPECT_EQ(error.problems()[0].allowed, nlohmann::json({1, 2}));
  EXPECT_EQ(error.problems()[0].unit, "V");
}

TEST(BenchMessages, CutShortOrTooLongIsRefused) {
  for (const auto& frame : frames()) {
    const auto payload = frame.substr(head_bytes);
    Message message{static_cast<Kind>(frame[6]), ""};
    ASSERT_EQ(again({message.kind, payload}), frame);
    for (std::size_t length = 0; length < payload.size(); ++length) {
      message.payload = payload.substr(0, length);
      EXPECT_THROW(again(message), Damaged) << frame[6] << ' ' << length;
    }
    message.payload = payload + '\0';
    EXPECT_THROW(again(message), Damaged);
  }
}

// Whatever a bit does, the message is refused or one that can be sent.
TEST(BenchMessages, FlippedBitsAreRefusedOrAnotherMessage) {
  std::mt19937_64 random(1);
  for (const auto& frame : frames())
    for (int i = 0; i < 3000; ++i) {
      auto bytes = frame;
      for (int flips = 0; flips < 1 + i % 3; ++flips)
        bytes[random() % bytes.size()] ^= static_cast<char>(1 << random() % 8);
      try {
        Inbox inbox;
        inbox.add(bytes);
        while (const auto message = inbox.next()) {
          again(*message);
          if (message->kind == Kind::prepare) (void)message->as<Prepare>().program.waveform();
        }
      } catch (const Damaged&) {
      }
    }
}

TEST(BenchMessages, AnotherVersionAndAnotherProgramAreRefused) {
  const auto whole = framed(Alive{});
  for (const auto& [place, value] :
       {std::pair{0, 'X'}, {4, static_cast<char>(version + 1)}, {6, '\x63'}, {11, '\x7f'}}) {
    auto bytes = whole;
    bytes[static_cast<std::size_t>(place)] = value;
    Inbox inbox;
    inbox.add(bytes);
    EXPECT_THROW(inbox.next(), Damaged) << place;
  }
}

TEST(BenchMessages, APieceThatIsNoneIsRefused) {
  auto program = prepare().program;
  program.pieces[0].duration = -1;
  EXPECT_THROW(program.waveform(), Damaged);
  program = prepare().program;
  program.pieces[1].levels = nullptr;
  EXPECT_THROW(program.waveform(), Damaged);
  program = prepare().program;
  program.segments.pop_back();
  EXPECT_THROW(program.waveform(), Damaged);
}

// An open file goes along, and a receiver that does not read keeps nobody waiting.
TEST(BenchMessages, AChannelNeverBlocksAndCarriesFiles) {
  std::array<int, 2> ends{};
  ASSERT_EQ(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()), 0);
  Channel a{Descriptor(ends[0])};
  std::optional<Channel> b(std::in_place, Descriptor(ends[1]));
  const Stop large{.reason = std::string(1u << 20, 'x')};
  a.send(framed(large));
  a.send(framed(Begin{.run = 5}), recordings::open_file("/dev/null", 0));
  EXPECT_TRUE(a.flush());
  EXPECT_GT(a.bytes_queued(), 0u);
  std::vector<Message> came;
  for (int i = 0; i < 1000 && came.size() < 2; ++i) {
    EXPECT_TRUE(b->receive());
    EXPECT_TRUE(a.flush());
    while (auto message = b->next()) came.push_back(std::move(*message));
  }
  ASSERT_EQ(came.size(), 2u);
  EXPECT_EQ(came[0].as<Stop>().reason.size(), large.reason.size());
  EXPECT_EQ(came[1].as<Begin>().run, 5u);
  EXPECT_TRUE(b->take_file());
  EXPECT_FALSE(b->take_file());
  b.reset();
  a.send(framed(Alive{}));
  EXPECT_FALSE(a.flush() && a.receive());
}

}  // namespace
}  // namespace ferrobench::bench
