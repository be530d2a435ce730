#pragma once

namespace ferrobench::emulator {

// What an endpoint says to a packet: taken or given, not now, halted.
enum class Handshake { ack, nak, stall };

}  // namespace ferrobench::emulator
