// The chain of a descent put into frames whose z is the joint's axis, once per problem.
#include <algorithm>
#include <cmath>

#include "ccd.hpp"

namespace ir::inverse {
namespace {

// Plain 3 x 3 products for the set-up.
void multiply(const double A[3][3], const double B[3][3], double C[3][3]) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) C[i][j] = A[i][0] * B[0][j] + A[i][1] * B[1][j] + A[i][2] * B[2][j];
}
void multiply_transposed(const double A[3][3], const double B[3][3], double C[3][3]) {  // A' B
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) C[i][j] = A[0][i] * B[0][j] + A[1][i] * B[1][j] + A[2][i] * B[2][j];
}
void split(const double* pose, double R[3][3], double p[3]) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) R[i][j] = pose[4 * i + j];
    p[i] = pose[4 * i + 3];
  }
}
// A rotation whose third column is `axis`.
void frame_about(const double* axis, double Q[3][3]) {
  const int least = std::abs(axis[0]) <= std::abs(axis[1]) && std::abs(axis[0]) <= std::abs(axis[2]) ? 0
                    : std::abs(axis[1]) <= std::abs(axis[2])                                         ? 1
                                                                                                     : 2;
  double x[3] = {0, 0, 0}, size = 0.0;
  x[least] = 1.0;
  for (int i = 0; i < 3; ++i) x[i] -= axis[least] * axis[i];
  for (double v : x) size += v * v;
  size = std::sqrt(size);
  for (int i = 0; i < 3; ++i) {
    Q[i][0] = x[i] / size;
    Q[i][2] = axis[i];
  }
  for (int i = 0; i < 3; ++i) Q[i][1] = Q[(i + 1) % 3][2] * Q[(i + 2) % 3][0] - Q[(i + 2) % 3][2] * Q[(i + 1) % 3][0];
}

}  // namespace

CcdProblem::CcdProblem(int joints, const double* origin, const double* axis, const double* base, const double* tcp,
                       const double* pose, const double* lower, const double* upper, double weight)
    : n(joints), rotation_length(weight) {
  double before[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};  // the frame before, in its link's own frame
  for (int i = 0; i < n; ++i) {
    double E[3][3], p[3], Q[3][3], EQ[3][3];
    split(origin + 16 * i, E, p);
    frame_about(axis + 3 * i, Q);
    multiply(E, Q, EQ);
    multiply_transposed(before, EQ, turn[i]);
    for (int k = 0; k < 3; ++k) offset[i][k] = before[0][k] * p[0] + before[1][k] * p[1] + before[2][k] * p[2];
    std::copy(&Q[0][0], &Q[0][0] + 9, &before[0][0]);
    low[i] = lower[i];
    high[i] = upper[i];
  }
  double T[3][3], p[3], B[3][3], b[3], first[3][3];
  split(tcp, T, p);
  multiply_transposed(before, T, tool_turn);
  for (int k = 0; k < 3; ++k) tool_offset[k] = before[0][k] * p[0] + before[1][k] * p[1] + before[2][k] * p[2];
  split(base, B, b);
  multiply(B, turn[0], first);
  double shifted[3];
  for (int k = 0; k < 3; ++k)
    shifted[k] = b[k] + B[k][0] * offset[0][0] + B[k][1] * offset[0][1] + B[k][2] * offset[0][2];
  std::copy(&first[0][0], &first[0][0] + 9, &turn[0][0][0]);
  std::copy(shifted, shifted + 3, offset[0]);
  split(pose, target_turn, target);
}

}  // namespace ir::inverse
