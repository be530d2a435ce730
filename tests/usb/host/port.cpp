#include "host/port.h"

#include <algorithm>
#include <utility>

#include "unit/requests.h"

namespace ferrobench::emulator {

bool Port::submit_in(std::uint64_t id, std::uint8_t endpoint, std::size_t length) {
  if (endpoint != input_endpoint) return false;
  in_.push_back({.id = id, .endpoint = endpoint, .length = length, .moved = 0, .data = {}});
  move();
  return true;
}

bool Port::submit_out(std::uint64_t id, std::uint8_t endpoint, std::span<const std::byte> data) {
  if (endpoint != output_endpoint) return false;
  out_.push_back({.id = id,
                  .endpoint = endpoint,
                  .length = data.size(),
                  .moved = 0,
                  .data = std::vector(data.begin(), data.end())});
  move();
  return true;
}

bool Port::cancel(std::uint64_t id) {
  for (auto* queue : {&in_, &out_}) {
    const auto at = std::find_if(queue->begin(), queue->end(), [&](const Transfer& t) { return t.id == id; });
    if (at == queue->end()) continue;
    std::rotate(queue->begin(), at, at + 1);
    finish(*queue, Outcome::cancelled);
    return true;
  }
  return false;
}

void Port::cancel_all() {
  for (auto* queue : {&in_, &out_})
    while (!queue->empty()) finish(*queue, Outcome::cancelled);
}

Outcome Port::control(const Request& request, std::span<const std::byte> data,
                      std::vector<std::byte>& answer) {
  answer.clear();
  if (!unit_.on_bus()) return Outcome::gone;
  auto result = unit_.control(request, data);
  move();
  if (!result) return Outcome::stall;
  answer = std::move(*result);
  return Outcome::ok;
}

void Port::advance(Ticks to) {
  while (unit_.now() < to) {
    const Ticks boundary = (unit_.now() / microframe + 1) * microframe;
    unit_.advance(std::min(boundary, to));
    if (boundary % frame() == 0 && unit_.now() == boundary) budget_ = packets_per_frame();
    move();
  }
}

std::vector<Finished> Port::take_finished() {
  return std::exchange(finished_, {});
}

void Port::move() {
  if (!unit_.on_bus()) {
    for (auto* queue : {&in_, &out_})
      while (!queue->empty()) finish(*queue, Outcome::gone);
    return;
  }
  // Turn by turn, as a host controller shares a microframe among its endpoints.
  bool in = true, out = true;
  while (budget_ > 0 && (in || out)) {
    if (in) in = move_in();
    if (budget_ > 0 && out) out = move_out();
  }
}

bool Port::move_in() {
  if (in_.empty()) return false;
  switch (unit_.take_packet(packet_)) {
    case Handshake::nak:
      return false;
    case Handshake::stall:
      finish(in_, Outcome::stall);
      return true;
    case Handshake::ack:
      break;
  }
  --budget_;
  Transfer& t = in_.front();
  if (packet_.size() > std::min(unit_.setup().max_packet(), t.length - t.moved)) {
    finish(in_, Outcome::babble);
    return true;
  }
  t.data.insert(t.data.end(), packet_.begin(), packet_.end());
  t.moved += packet_.size();
  if (t.moved == t.length || packet_.size() < unit_.setup().max_packet()) finish(in_, Outcome::ok);
  return true;
}

bool Port::move_out() {
  if (out_.empty()) return false;
  Transfer& t = out_.front();
  const std::size_t size = std::min(unit_.setup().max_packet(), t.length - t.moved);
  switch (unit_.give_packet(std::span<const std::byte>(t.data).subspan(t.moved, size))) {
    case Handshake::nak:
      return false;
    case Handshake::stall:
      finish(out_, Outcome::stall);
      return true;
    case Handshake::ack:
      break;
  }
  --budget_;
  t.moved += size;
  if (t.moved == t.length) finish(out_, Outcome::ok);
  return true;
}

void Port::finish(std::deque<Transfer>& queue, Outcome outcome) {
  Transfer t = std::move(queue.front());
  queue.pop_front();
  const bool in = (t.endpoint & 0x80U) != 0;
  finished_.push_back({.id = t.id,
                       .endpoint = t.endpoint,
                       .outcome = outcome,
                       .moved = t.moved,
                       .data = in ? std::move(t.data) : std::vector<std::byte>{}});
}

}  // namespace ferrobench::emulator
