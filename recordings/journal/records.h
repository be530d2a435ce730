// The journal of a run: what goes to the disk while it is measured, beside the HDF5 file that is made of it
// at the end.
//
// A sequence of records, each a head of 40 bytes and its payload, little-endian; nothing is ever changed,
// only appended.
//
//   magic "FBJR" | kind | sequence 0, 1, .. (8 bytes) | bytes of payload (8) | rows (4) | CRC-32 of payload |
//   0 | CRC-32 of the 36 bytes before
//
//   begin  JSON: header, channels, raw columns; the first record
//   rows   time, then each channel (doubles), then the counts (16 bits, row after row)
//   event  JSON
//   end    JSON: status, reason, end time, segments, noise; the last record of a run that was closed
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "recordings/format/parts.h"

namespace ferrobench::recordings {

enum class RecordKind : std::uint32_t { begin = 1, rows = 2, event = 3, end = 4 };

struct RecordHead {
  RecordKind kind{};
  std::uint64_t sequence = 0;
  std::uint64_t bytes = 0;
  std::uint32_t rows = 0;
  std::uint32_t checksum = 0;  // of the payload
};
inline constexpr std::size_t head_bytes = 40;
inline constexpr std::uint64_t most_payload = 1u << 28;

// Both of these write into `storage`, whose memory is used again.
std::string encode(RecordKind kind, std::uint64_t sequence, std::uint32_t rows, std::string_view payload,
                   std::string storage = {});
// None if these are not the bytes of a head, whole and undamaged.
std::optional<RecordHead> decode_head(std::string_view bytes);
bool fits(const RecordHead& head, std::string_view payload);  // the checksum

// Rows [first, first + count) as a payload; and back, added to `out`.
std::string rows_payload(const Begin& begin, const Rows& rows, std::size_t first, std::size_t count,
                         std::string storage = {});
void add_rows(const Begin& begin, const RecordHead& head, std::string_view payload, Columns& out);

}  // namespace ferrobench::recordings
