#include "daq/usb/block_queue.h"

namespace ferrobench::daq::usb {

namespace {

void clear(SampleBlock& block) {
  block.first_sample = 0;
  block.rows = 0;
  block.counts.clear();
  block.status = BlockStatus::ok;
  block.message.clear();
}

}  // namespace

void BlockQueue::prepare(std::size_t blocks, std::size_t counts) {
  const std::scoped_lock lock(mutex_);
  for (std::size_t i = 0; i < blocks; ++i) {
    SampleBlock block;
    block.counts.reserve(counts);
    empty_.push_back(std::move(block));
  }
}

SampleBlock BlockQueue::take_empty() {
  const std::scoped_lock lock(mutex_);
  if (empty_.empty()) return {};
  auto block = std::move(empty_.back());
  empty_.pop_back();
  return block;
}

bool BlockQueue::put(SampleBlock block) {
  const std::scoped_lock lock(mutex_);
  if (full_.size() >= capacity) return false;
  full_.push_back(std::move(block));
  came_.notify_one();
  return true;
}

void BlockQueue::put_last(SampleBlock block) {
  const std::scoped_lock lock(mutex_);
  full_.push_back(std::move(block));
  ended_ = true;
  came_.notify_one();
}

void BlockQueue::end() {
  const std::scoped_lock lock(mutex_);
  ended_ = true;
  came_.notify_one();
}

bool BlockQueue::take(SampleBlock& block) {
  clear(block);
  std::unique_lock lock(mutex_);
  if (!came_.wait_for(lock, std::chrono::seconds(1), [&] { return !full_.empty() || ended_; })) {
    block.status = BlockStatus::timeout;
    block.message = "no sample has come yet";
    return true;
  }
  if (full_.empty()) return false;
  // Command and events belong to the reader's side and stay with its block.
  auto& next = full_.front();
  std::swap(block.counts, next.counts);
  std::swap(block.message, next.message);
  block.first_sample = next.first_sample;
  block.rows = next.rows;
  block.status = next.status;
  clear(next);
  if (!empty_.full()) empty_.push_back(std::move(next));
  full_.pop_front();
  return true;
}

}  // namespace ferrobench::daq::usb
