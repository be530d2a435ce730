// The USB/IP server against the published protocol, by a client socket.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <random>
#include <thread>

#include "boards/pattern.h"
#include "client.h"
#include "usbip/server.h"
#include "usbip/session.h"

namespace ferrobench::emulator {
namespace {

namespace wire = usbip;

class UsbipTest : public testing::Test {
 protected:
  ~UsbipTest() override {
    close(socket_);
    server.stop();
    thread.join();
  }
  void connect_again() {
    close(socket_);
    socket_ = connected();
  }
  int connected() const {
    const int s = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(server.port());
    EXPECT_EQ(connect(s, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    const timeval patience{.tv_sec = 20, .tv_usec = 0};
    setsockopt(s, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    return s;
  }
  void send_bytes(const Bytes& bytes) {
    ASSERT_EQ(send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL), static_cast<ssize_t>(bytes.size()));
  }
  // Fewer if the other side closes.
  Bytes receive(std::size_t size) {
    Bytes out(size);
    const auto got = recv(socket_, out.data(), size, MSG_WAITALL);
    out.resize(static_cast<std::size_t>(std::max<ssize_t>(0, got)));
    return out;
  }

  void import_device() {
    send_bytes(wire::Writer().u16(wire::version).u16(wire::import_request).u32(0).text("1-1", 32).take());
    const Bytes reply = receive(8 + 312);
    ASSERT_EQ(reply.size(), 8U + 312U);
    EXPECT_EQ(wire::get16_big(std::span(reply).subspan(2)), wire::import_reply);
    EXPECT_EQ(wire::get32_big(std::span(reply).subspan(4)), 0U);
    EXPECT_EQ(wire::get16_big(std::span(reply).subspan(8 + 300)), 0x09DB);
    EXPECT_EQ(wire::get16_big(std::span(reply).subspan(8 + 302)), 0x0136);
  }
  std::uint32_t submit(std::uint32_t endpoint, bool in, std::size_t length, const Bytes& setup = Bytes(8),
                       const Bytes& data = {}) {
    wire::Header h{.command = wire::submit,
                   .sequence = ++sequence,
                   .device = wire::device_id,
                   .direction = in ? wire::direction_in : wire::direction_out,
                   .endpoint = endpoint,
                   .word = 0,
                   .length = static_cast<std::uint32_t>(length),
                   .start_frame = 0,
                   .packets = 0xFFFFFFFF,
                   .interval = 0,
                   .setup = setup};
    Bytes bytes = wire::to_bytes(h);
    bytes.insert(bytes.end(), data.begin(), data.end());
    send_bytes(bytes);
    return sequence;
  }
  struct Reply {
    wire::Header header;
    Bytes data;
    int status() const { return static_cast<int>(header.word); }
  };
  Reply reply(bool in) {
    const Bytes bytes = receive(wire::header_size);
    if (bytes.size() != wire::header_size) return {};
    Reply out{wire::parse_header(bytes), {}};
    if (in && out.header.length > 0) out.data = receive(out.header.length);
    return out;
  }
  Reply control(bool in, unsigned number, std::size_t length, const Bytes& data = {}) {
    submit(0, in, length,
           bytes_of({in ? 0xC0U : 0x40U, number, 0, 0, 0, 0, static_cast<unsigned>(length & 0xFFU),
                     static_cast<unsigned>(length >> 8)}),
           data);
    return reply(in);
  }
  Reply write(unsigned number, const Bytes& data = {}) { return control(false, number, data.size(), data); }

  static EmulatorConfig config() {
    EmulatorConfig c;
    c.board = BoardKind::pattern;
    c.perfect = true;
    c.patience = 5;
    return c;
  }
  Emulator emulator{config()};
  wire::Server server{emulator, 0};
  std::thread thread{[this] { server.run(); }};
  int socket_ = connected();
  std::uint32_t sequence = 0;
};

TEST_F(UsbipTest, ListsTheDeviceAndClosesTheConnection) {
  send_bytes(wire::Writer().u16(wire::version).u16(wire::devlist_request).u32(0).take());
  const Bytes reply = receive(10'000);
  ASSERT_EQ(reply.size(), 12U + 312 + 4);
  EXPECT_EQ(wire::get16_big(std::span(reply).subspan(2)), wire::devlist_reply);
  EXPECT_EQ(wire::get32_big(std::span(reply).subspan(8)), 1U) << "devices";
  EXPECT_EQ(wire::get32_big(std::span(reply).subspan(12 + 256 + 32 + 8)), 3U) << "high speed";
  EXPECT_EQ(reply.at(12 + 311), std::byte{1}) << "interfaces";
}

TEST_F(UsbipTest, RefusesABusIdThatItHasNot) {
  send_bytes(wire::Writer().u16(wire::version).u16(wire::import_request).u32(0).text("2-7", 32).take());
  const Bytes reply = receive(1000);
  ASSERT_EQ(reply.size(), 8U) << "and closes";
  EXPECT_EQ(wire::get32_big(std::span(reply).subspan(4)), 1U);
}

TEST_F(UsbipTest, CarriesAWholeScan) {
  import_device();
  EXPECT_EQ(write(request::trigger, bytes_of({3})).status(), -EPIPE) << "without FPGA";
  EXPECT_EQ(write(request::fpga_configure, bytes_of({fpga_key})).status(), 0);
  for (std::size_t sent = 0; sent < 73722; sent += 64)
    ASSERT_EQ(write(request::fpga_data, Bytes(std::min<std::size_t>(64, 73722 - sent))).status(), 0);
  const Reply status = control(true, request::status, 2);
  EXPECT_EQ(status.data, bytes_of({0, 1}));
  EXPECT_EQ(write(request::queue, queue_of({0, 1})).header.length, 16U);
  constexpr std::size_t scans = 5000, transfer = 8192;
  std::size_t under_way = 0;
  for (; under_way * transfer <= 4 * scans; ++under_way) submit(6, true, transfer);
  EXPECT_EQ(write(request::input_start, input_order({.scans = scans, .period = 639})).status(), 0);
  std::size_t sample = 0;
  for (; under_way > 0; --under_way) {
    const Reply r = reply(true);
    ASSERT_EQ(r.header.command, wire::submit_reply);
    ASSERT_EQ(r.status(), 0);
    for (std::size_t i = 0; i + 1 < r.data.size(); i += 2)
      ASSERT_EQ(get16(std::span(r.data).subspan(i)), PatternBoard::code(sample++));
    if (r.data.size() < transfer) break;
  }
  EXPECT_EQ(sample, 2 * scans);
}

TEST_F(UsbipTest, UnlinksWhatIsUnderWayAndOnlyThat) {
  import_device();
  const std::uint32_t waiting = submit(6, true, 512);
  wire::Header h{.command = wire::unlink, .sequence = ++sequence, .device = wire::device_id, .setup = {}};
  h.word = waiting;
  send_bytes(wire::to_bytes(h));
  Reply r = reply(false);
  EXPECT_EQ(r.header.command, wire::unlink_reply);
  EXPECT_EQ(r.header.sequence, sequence);
  EXPECT_EQ(r.status(), -ECONNRESET);
  h.sequence = ++sequence;
  send_bytes(wire::to_bytes(h));
  r = reply(false);
  EXPECT_EQ(r.header.command, wire::unlink_reply);
  EXPECT_EQ(r.status(), 0) << "it is not there any more";
  EXPECT_EQ(control(true, request::status, 2).status(), 0) << "the connection lives";
}

TEST_F(UsbipTest, AnEndpointThatIsNotThereIsAnError) {
  import_device();
  submit(9, true, 512);
  EXPECT_EQ(reply(true).status(), -ENOENT);
}

TEST_F(UsbipTest, NonsenseClosesTheConnectionAndTheNextOneWorks) {
  std::mt19937 random(5);
  for (int i = 0; i < 20; ++i) {
    if (i % 2 == 0) import_device();
    Bytes noise(200);
    for (std::byte& b : noise) b = static_cast<std::byte>(random() | 0x40U);  // never a command or version
    send_bytes(noise);
    EXPECT_EQ(receive(1).size(), 0U);
    connect_again();
  }
  import_device();
  EXPECT_EQ(control(true, request::serial, 8).data.size(), 8U);
}

TEST(UsbipSession, TakesBytesHoweverTheyAreCut) {
  Client client;
  wire::Session whole(client.port), cut(client.port);
  Bytes all = wire::Writer().u16(wire::version).u16(wire::import_request).u32(0).text("1-1", 32).take();
  const Bytes command = wire::to_bytes({.command = wire::submit,
                                        .sequence = 1,
                                        .device = wire::device_id,
                                        .direction = wire::direction_in,
                                        .endpoint = 0,
                                        .word = 0,
                                        .length = 2,
                                        .start_frame = 0,
                                        .packets = 0,
                                        .interval = 0,
                                        .setup = bytes_of({0xC0, request::status, 0, 0, 0, 0, 2, 0})});
  all.insert(all.end(), command.begin(), command.end());
  whole.receive(all);
  for (const std::byte b : all) cut.receive(std::span(&b, 1));
  const Bytes expected = whole.take_output();
  EXPECT_EQ(expected.size(), 8U + 312 + 48 + 2);
  EXPECT_EQ(cut.take_output(), expected);
}

TEST(UsbipSession, AGoneUnitEndsIt) {
  Client client;
  wire::Session session(client.port);
  session.receive(wire::Writer().u16(wire::version).u16(wire::import_request).u32(0).text("1-1", 32).take());
  EXPECT_FALSE(session.closed());
  client.unit.unplug();
  session.collect();
  EXPECT_TRUE(session.closed());
  client.unit.plug();
  wire::Session of_before(client.port);
  of_before.receive(
      wire::Writer().u16(wire::version).u16(wire::import_request).u32(0).text("1-1", 32).take());
  EXPECT_FALSE(of_before.closed());
  client.unit.unplug();
  client.unit.plug();
  of_before.collect();
  EXPECT_TRUE(of_before.closed()) << "the one that came back is another device";
  client.unit.unplug();
  wire::Session next(client.port);
  next.receive(wire::Writer().u16(wire::version).u16(wire::devlist_request).u32(0).take());
  const Bytes none = next.take_output();
  ASSERT_EQ(none.size(), 12U);
  EXPECT_EQ(wire::get32_big(std::span(none).subspan(8)), 0U);
}

}  // namespace
}  // namespace ferrobench::emulator
