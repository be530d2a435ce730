// One item of a batch, from its inputs to its result. Whoever asks for it, on whichever machine and with
// however many threads, gets the same bytes.
#pragma once

#include "server/batch/folder.h"

namespace ferrobench::batch {

// What a result is of: {kind, software, commit, model, inputs: [{name, file, sha256}], held_out, options}. An
// import's inputs say when they were written, too: their recordings begin then. Throws what reading the
// inputs throws.
nlohmann::json asked_of(Kind kind, const Item& item);

// Does the work and puts the result into the folder: {id, asked, state: "done", rows, units, products,
// result}, or what went wrong, {id, asked, state: "failed", error: {code, message, problems}}. Throws only
// where the result itself cannot be written.
void carry_out(Kind kind, const Item& item, int threads, const BatchFolder& folder);
// For an item that nothing more can be learned of.
void put_failure(Kind kind, const Item& item, const Error& error, const BatchFolder& folder);

// The result that lies in the folder; null if there is none or it cannot be read.
nlohmann::json read_result(const std::string& id, const BatchFolder& folder);
// By its result, what that was asked, and what lies in the inputs now.
State state_of(Kind kind, const Item& item, const BatchFolder& folder);

}  // namespace ferrobench::batch
