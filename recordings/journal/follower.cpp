#include "recordings/journal/follower.h"

#include <sys/stat.h>

namespace ferrobench::recordings {

namespace {

bool read_all(const Descriptor& file, std::uint64_t place, char* to, std::size_t count) {
  return read_at(file, place, to, count).count == count;
}

std::uint64_t size_of(const Descriptor& file) {
  struct stat info {};
  return fstat(file.get(), &info) == 0 ? static_cast<std::uint64_t>(info.st_size) : 0;
}

}  // namespace

JournalFollower::JournalFollower(Descriptor journal, Begin begin)
    : journal_(std::move(journal)), begin_(std::move(begin)) {
  pass_over();
}

void JournalFollower::next(std::uint64_t most, const std::function<void(const Columns&)>& take) {
  const auto size = size_of(journal_);
  std::array<char, head_bytes> bytes{};
  while (place_ + head_bytes <= size && read_all(journal_, place_, bytes.data(), bytes.size())) {
    const auto head = decode_head({bytes.data(), bytes.size()});
    if (!head || place_ + head_bytes + head->bytes > size) return;
    const auto payload_at = place_ + head_bytes;
    place_ = payload_at + head->bytes;
    if (head->kind != RecordKind::rows || size - payload_at > most ||
        head->bytes != head->rows * begin_.row_bytes())
      continue;
    payload_.resize(head->bytes);
    if (!read_all(journal_, payload_at, payload_.data(), payload_.size()) || !fits(*head, payload_)) continue;
    columns_.clear();
    add_rows(begin_, *head, payload_, columns_);
    take(columns_);
  }
}

}  // namespace ferrobench::recordings
