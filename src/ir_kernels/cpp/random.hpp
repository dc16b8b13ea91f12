// Random numbers that are the same on every machine: no function of a library is asked.
//
// xoshiro256++ (D. Blackman, S. Vigna, "Scrambled linear pseudorandom number generators", 2021), its state filled by
// splitmix64.
#pragma once

#include <cstdint>

namespace ir {

class Random {
 public:
  explicit Random(std::uint64_t seed) {
    for (std::uint64_t& word : state_) {
      seed += 0x9e3779b97f4a7c15u;
      std::uint64_t z = seed;
      z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
      z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
      word = z ^ (z >> 31);
    }
  }

  std::uint64_t bits() {
    std::uint64_t* s = state_;
    const std::uint64_t result = rotated(s[0] + s[3], 23) + s[0], shifted = s[1] << 17;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= shifted;
    s[3] = rotated(s[3], 45);
    return result;
  }
  // in [0, 1)
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
  // 0 .. count - 1; the bias of the multiplication is below count / 2^32
  int below(int count) { return static_cast<int>(((bits() >> 32) * static_cast<std::uint64_t>(count)) >> 32); }
  // bell-shaped, mean 0 and variance 1, within +-3.5: the sum of four uniform numbers
  double bell() {
    const std::uint64_t b = bits();
    const double sum = static_cast<double>((b & 0xffff) + (b >> 16 & 0xffff) + (b >> 32 & 0xffff) + (b >> 48));
    return (sum - 131070.0) * (1.7320508075688772 / 65536.0);
  }

 private:
  static std::uint64_t rotated(std::uint64_t x, int by) { return (x << by) | (x >> (64 - by)); }
  std::uint64_t state_[4];
};

}  // namespace ir
