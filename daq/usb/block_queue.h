// Blocks of samples on their way from the thread that owns the link to the one that reads. The blocks' memory
// goes round.
#pragma once

#include <boost/circular_buffer.hpp>
#include <condition_variable>
#include <mutex>

#include "daq/device.h"

namespace ferrobench::daq::usb {

class BlockQueue {
 public:
  static constexpr std::size_t capacity = 4096;  // 100 s of them

  // So many blocks with room for so many counts. More are made while the reader is farther behind than that.
  void prepare(std::size_t blocks, std::size_t counts);
  SampleBlock take_empty();
  // False: nobody reads, there is no room.
  bool put(SampleBlock block);
  void put_last(SampleBlock block);  // always fits
  void end();                        // nothing comes after what is in the queue

  // Swaps the next block into `block`. False: the end. Without one for a second, status timeout.
  bool take(SampleBlock& block);

 private:
  std::mutex mutex_;
  std::condition_variable came_;
  boost::circular_buffer<SampleBlock> full_{capacity + 1}, empty_{capacity + 1};
  bool ended_ = false;
};

}  // namespace ferrobench::daq::usb
