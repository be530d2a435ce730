// The machine's limit for the model's kernel: how fast the same vector library takes exponentials alone, with
// data in the first-level cache, on the instruction set that the kernel is using.
#pragma once

#include <cstddef>

namespace ferrobench::bench {

// out[i] = exp(in[i]); count a multiple of 64.
void vector_exp(const double* in, double* out, std::size_t count);

}  // namespace ferrobench::bench
