#include "daq/usb/transfers.h"

#include <algorithm>
#include <cassert>

#include "daq/usb/unit.h"

namespace ferrobench::daq::usb {

void Transfers::prepare(std::size_t inputs, std::size_t input_bytes, std::size_t outputs,
                        std::size_t output_bytes) {
  assert(in_flight_ == 0);
  transfers_.clear();
  order_ = boost::circular_buffer<std::uint64_t>(inputs);
  completions_.reserve(inputs + outputs);
  for (std::size_t i = 0; i < inputs + outputs; ++i) {
    const bool input = i < inputs;
    transfers_.push_back(
        {.input = input, .buffer = std::vector<std::byte>(input ? input_bytes : output_bytes)});
  }
}

Transfers::Transfer* Transfers::idle_output() {
  const auto found = std::ranges::find_if(transfers_, [](auto& t) { return !t.input && !t.in_flight; });
  return found == transfers_.end() ? nullptr : &*found;
}

LinkStatus Transfers::submit(Link& link, Transfer& transfer, std::size_t size) {
  assert(!transfer.in_flight && size > 0 && size <= transfer.buffer.size());
  const auto token = static_cast<std::uint64_t>(
      std::ranges::find_if(transfers_, [&](auto& t) { return &t == &transfer; }) - transfers_.begin());
  transfer.size = size;
  const auto bytes = std::span(transfer.buffer).first(size);
  const auto status = transfer.input ? link.submit_in(input_endpoint, bytes, token)
                                     : link.submit_out(output_endpoint, bytes, token);
  if (status != LinkStatus::ok) return status;
  transfer.in_flight = true;
  ++in_flight_;
  if (transfer.input) order_.push_back(token);
  return status;
}

void Transfers::wait(Link& link, std::chrono::milliseconds timeout, std::vector<Done>& out) {
  completions_.clear();
  link.wait(timeout, completions_);
  for (const auto& c : completions_) {
    if (c.token >= transfers_.size() || !transfers_[c.token].in_flight) {
      out.push_back({.transfer = nullptr, .status = LinkStatus::error});
      continue;
    }
    auto& transfer = transfers_[c.token];
    transfer.in_flight = false;
    --in_flight_;
    Done done{&transfer, c.status, std::min(c.actual, transfer.size)};
    if (done.status == LinkStatus::ok && c.actual > transfer.size) done.status = LinkStatus::overflow;
    if (transfer.input) {
      if (order_.front() != c.token && done.status == LinkStatus::ok) done.status = LinkStatus::error;
      order_.erase(std::ranges::find(order_, c.token));
    }
    out.push_back(done);
  }
}

bool Transfers::cancel(Link& link, HostClock& clock) {
  constexpr std::chrono::milliseconds step{10};
  constexpr std::chrono::seconds patience{1};
  if (in_flight_ == 0) return true;
  link.cancel_all();
  std::vector<Done> done;
  for (const auto begin = clock.now(); in_flight_ > 0 && clock.now() - begin < patience;)
    wait(link, step, done);
  return in_flight_ == 0;
}

void Transfers::forget() {
  transfers_.clear();
  order_.clear();
  in_flight_ = 0;
}

}  // namespace ferrobench::daq::usb
