#pragma once

namespace flamefield::testing_support {

// Sanitized programs run this many times slower: tests that share the clock with simulated cameras slow down the
// pulses, and wait longer, by it.
#if defined(__SANITIZE_THREAD__)
constexpr int kSlowdown = 8;
#elif defined(__SANITIZE_ADDRESS__)
constexpr int kSlowdown = 5;
#else
constexpr int kSlowdown = 1;
#endif

}  // namespace flamefield::testing_support
