// The bulk transfers of a stream and their buffers, which outlive the link: whatever a link still holds when
// all else has failed has its memory.
#pragma once

#include <boost/circular_buffer.hpp>
#include <deque>
#include <memory>
#include <vector>

#include "daq/usb/host_clock.h"
#include "daq/usb/link.h"

namespace ferrobench::daq::usb {

class Transfers {
 public:
  struct Transfer {
    bool input = false;
    bool in_flight = false;
    std::size_t size = 0;  // bytes handed to the link
    std::vector<std::byte> buffer;
  };
  struct Done {
    Transfer* transfer = nullptr;
    LinkStatus status = LinkStatus::ok;
    std::size_t actual = 0;
  };

  // `inputs` and `outputs` transfers of so many bytes. None may be in flight.
  void prepare(std::size_t inputs, std::size_t input_bytes, std::size_t outputs, std::size_t output_bytes);
  std::deque<Transfer>& all() { return transfers_; }
  Transfer* idle_output();
  std::size_t in_flight(bool inputs) const { return inputs ? order_.size() : in_flight_ - order_.size(); }

  LinkStatus submit(Link& link, Transfer& transfer, std::size_t size);
  // Completions, in the order that they came. Answers that no transfer waits for, more bytes than asked for
  // and inputs out of their order are errors.
  void wait(Link& link, std::chrono::milliseconds timeout, std::vector<Done>& out);
  // Takes back what is in flight. False: some did not come back in time.
  bool cancel(Link& link, HostClock& clock);
  // After the link is closed: nothing comes back any more.
  void forget();

 private:
  std::deque<Transfer> transfers_;               // token: index
  boost::circular_buffer<std::uint64_t> order_;  // of the inputs in flight
  std::size_t in_flight_ = 0;
  std::vector<Completion> completions_;
};

}  // namespace ferrobench::daq::usb
