// From links and joints to modified Denavit-Hartenberg frames and base inertial parameters.
#include "dynamics_model.hpp"

#include <cmath>

#include "elementary.hpp"

namespace ir::dynamics {
namespace {

constexpr double kAligned = 1e-12;  // sines below this count as zero

Vec3 operator+(const Vec3& a, const Vec3& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
Vec3 operator-(const Vec3& a, const Vec3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Vec3 operator*(double s, const Vec3& a) { return {s * a[0], s * a[1], s * a[2]}; }
double dot(const Vec3& a, const Vec3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Vec3 operator*(const Mat3& m, const Vec3& a) { return {dot(m[0], a), dot(m[1], a), dot(m[2], a)}; }
Mat3 transpose(const Mat3& m) {
  Mat3 t;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) t[i][j] = m[j][i];
  return t;
}
Mat3 operator*(const Mat3& a, const Mat3& b) {
  const Mat3 t = transpose(b);
  Mat3 m;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) m[i][j] = dot(a[i], t[j]);
  return m;
}
double norm(const Vec3& a) { return std::sqrt(dot(a, a)); }
double tidy(double x) { return std::abs(x) < kAligned ? 0.0 : x; }

Vec3 any_normal(const Vec3& z) {
  const Vec3 other = std::abs(z[0]) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
  const Vec3 x = other - dot(other, z) * z;
  return (1.0 / norm(x)) * x;
}

// Mass, first moment and inertia about the origin of a frame.
struct Body {
  double mass = 0;
  Vec3 moment{};
  Mat3 inertia{};
};

// The same body seen from a frame in which its own frame has the orientation R and the origin r.
Body seen_from(const Body& b, const Mat3& R, const Vec3& r) {
  const Vec3 h = R * b.moment;
  Mat3 inertia = R * b.inertia * transpose(R);
  const double spread = b.mass * dot(r, r) + 2.0 * dot(r, h);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      inertia[i][j] += (i == j ? spread : 0.0) - b.mass * r[i] * r[j] - r[i] * h[j] - h[i] * r[j];
  return {b.mass, h + b.mass * r, inertia};
}

void add(Body& a, const Body& b) {
  a.mass += b.mass;
  a.moment = a.moment + b.moment;
  for (int i = 0; i < 3; ++i) a.inertia[i] = a.inertia[i] + b.inertia[i];
}

// The part of a body that looks the same from every angle about z: it can ride on the link before the joint.
Body take_round_part(Body& b) {
  Body round;
  round.mass = b.mass;
  round.moment = {0, 0, b.moment[2]};
  const double yy = b.inertia[1][1];
  round.inertia = {Vec3{yy, 0, 0}, Vec3{0, yy, 0}, Vec3{0, 0, 0}};
  b.mass = 0;
  b.moment[2] = 0;
  b.inertia[0][0] -= yy;
  b.inertia[1][1] = 0;
  return round;
}

struct Frame {
  Vec3 x, z, o;
  Mat3 axes() const { return transpose(Mat3{x, cross(z, x), z}); }  // columns x, y, z
};

// Origins and axes of the joints at q = 0, in the frame of link 0, with the links' orientations and origins there.
struct Lines {
  std::vector<Vec3> o, z;
  std::vector<Mat3> R;
};

Lines joint_lines(const ChainInput& in) {
  Lines lines;
  Mat3 R{Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};
  Vec3 o{};
  for (int i = 0; i < in.n; ++i) {
    const double* T = &in.origin[16 * i];
    o = o + R * Vec3{T[3], T[7], T[11]};
    R = R * Mat3{Vec3{T[0], T[1], T[2]}, Vec3{T[4], T[5], T[6]}, Vec3{T[8], T[9], T[10]}};
    lines.o.push_back(o);
    lines.R.push_back(R);
    lines.z.push_back(R * Vec3{in.axis[3 * i], in.axis[3 * i + 1], in.axis[3 * i + 2]});
  }
  return lines;
}

// Modified Denavit-Hartenberg frames at q = 0. x of frame i is the common normal of axes i and i+1.
std::vector<Frame> frames_of(const Lines& lines) {
  const int n = static_cast<int>(lines.z.size());
  std::vector<Frame> frames(n);
  for (int i = 0; i < n; ++i) {
    Frame& f = frames[i];
    f.z = lines.z[i];
    if (i + 1 == n) {  // free: the foot of the common normal with the axis before, so that d = 0
      f.o = lines.o[i];
      f.x = any_normal(f.z);
      if (i > 0) {
        const Vec3 across = cross(lines.z[i - 1], f.z);
        const double square = dot(across, across);
        const Vec3 gap = lines.o[i] - lines.o[i - 1];
        const double along = square > kAligned ? dot(cross(gap, lines.z[i - 1]), across) / square
                                               : dot(frames[i - 1].o - lines.o[i], f.z);
        f.o = lines.o[i] + along * f.z;
        f.x = frames[i - 1].x;
      }
      continue;
    }
    const Vec3 across = cross(f.z, lines.z[i + 1]);
    const double sine = norm(across);
    const Vec3 gap = lines.o[i + 1] - lines.o[i];
    if (sine > kAligned) {
      const double along = dot(cross(gap, lines.z[i + 1]), across) / (sine * sine);
      f.o = lines.o[i] + along * f.z;
      f.x = (1.0 / sine) * across;
    } else {  // parallel: any common normal, take the one through this frame's natural origin
      f.o = i > 0 ? lines.o[i] + dot(frames[i - 1].o - lines.o[i], f.z) * f.z : lines.o[i];
      const Vec3 normal = gap - dot(gap, f.z) * f.z;
      f.x = norm(normal) > kAligned ? (1.0 / norm(normal)) * normal : any_normal(f.z);
    }
  }
  return frames;
}

Body body_of(const ChainInput& in, const Lines& lines, int i, const Frame& frame) {
  Body about_com;
  about_com.mass = in.mass[i];
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) about_com.inertia[a][b] = in.inertia[9 * i + 3 * a + b];
  const Mat3 to_frame = transpose(frame.axes());
  const Vec3 com = lines.R[i] * Vec3{in.com[3 * i], in.com[3 * i + 1], in.com[3 * i + 2]};
  return seen_from(about_com, to_frame * lines.R[i], to_frame * (lines.o[i] + com - frame.o));
}

double gas_force_per_length(const ChainInput& in, double square) {
  const double length = std::sqrt(square);
  const double volume = in.gas_volume - in.piston_area * (length - in.rod_length);
  return in.charge_pressure * ir::power(in.gas_volume / volume, in.exponent) * in.piston_area / length;
}

// Chebyshev interpolation over all lengths that the geometry allows, rewritten in powers of the scaled square.
// long: one check per value of the counterbalance
Balance<double> balance_of(const ChainInput& in, const Joint<double>* joints) {
  Balance<double> b;
  b.joint = in.balanced_joint;
  if (b.joint < 0) return b;
  const auto [bx, bz] = in.pivot;
  const auto [ex, ez] = in.eye;
  const double C = ir::cosine(joints[b.joint].theta0), S = ir::sine(joints[b.joint].theta0);
  const auto in_theta = [C, S](double cosine, double sine, double& of_cos, double& of_sin) {
    of_cos = cosine * C - sine * S;  // cosine cos q + sine sin q, written in theta = q + theta0
    of_sin = cosine * S + sine * C;
  };
  in_theta(ez * bx - ex * bz, -ex * bx - ez * bz, b.lever_cos, b.lever_sin);
  const double centre = bx * bx + bz * bz + ex * ex + ez * ez;
  const double half = 2.0 * ir::length(bx, bz) * ir::length(ex, ez);
  const double scale = half > 0.0 ? 1.0 / half : 0.0;
  in_theta(-2.0 * (bx * ex + bz * ez) * scale, -2.0 * (bx * ez - bz * ex) * scale, b.square_cos, b.square_sin);
  constexpr int m = Balance<double>::kTerms;
  double chebyshev[m];
  for (int k = 0; k < m; ++k) {
    double sum = 0.0;
    for (int j = 0; j < m; ++j) {
      const double angle = M_PI * (j + 0.5) / m;
      sum += gas_force_per_length(in, centre + half * ir::cosine(angle)) * ir::cosine(k * angle);
    }
    chebyshev[k] = (k == 0 ? 1.0 : 2.0) / m * sum;
  }
  double before[m] = {1.0}, now[m] = {0.0, 1.0};
  for (double& c : b.coefficient) c = 0.0;
  for (int k = 0; k < m; ++k) {
    const double* T = k == 0 ? before : now;
    for (int j = 0; j <= k; ++j) b.coefficient[j] += chebyshev[k] * T[j];
    if (k == 0) continue;
    double next[m];
    for (int j = 0; j < m; ++j) next[j] = (j > 0 ? 2.0 * now[j - 1] : 0.0) - before[j];
    for (int j = 0; j < m; ++j) {
      before[j] = now[j];
      now[j] = next[j];
    }
  }
  return b;
}

// What stands on the rail, as if the rail weren't there.
ChainInput on_the_rail(const ChainInput& in) {
  ChainInput arm = in;
  arm.first_slides = false;
  --arm.n;
  const auto drop = [](std::vector<double>& values, int count) { values.erase(values.begin(), values.begin() + count); };
  for (std::vector<double>* one : {&arm.mass, &arm.rotor, &arm.viscous, &arm.coulomb, &arm.ratio, &arm.copper}) drop(*one, 1);
  drop(arm.origin, 16);
  drop(arm.axis, 3);
  drop(arm.com, 3);
  drop(arm.inertia, 9);
  drop(arm.envelope_speed, in.knots);
  drop(arm.envelope_torque, in.knots + 1);
  for (int i = 0; i < 3; ++i)  // the first joint seen from the base
    for (int j = 0; j < 4; ++j) {
      double sum = j == 3 ? in.origin[4 * i + 3] : 0.0;
      for (int k = 0; k < 3; ++k) sum += in.origin[4 * i + k] * in.origin[16 + 4 * k + j];
      arm.origin[4 * i + j] = sum;
    }
  if (arm.balanced_joint >= 0) --arm.balanced_joint;
  for (std::vector<double>* matrix : {&arm.turns, &arm.inverse}) {
    std::vector<double> inner;
    for (int i = 1; i < in.n; ++i)
      for (int j = 1; j < in.n; ++j) inner.push_back((*matrix)[i * in.n + j]);
    *matrix = inner;
  }
  return arm;
}

Model<double> arm_model(const ChainInput& in, const Vec3* along);

// The arm's model moved by one joint, with the rail before it.
Model<double> model_with_rail(const ChainInput& in) {
  Vec3 along{};
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) along[i] += in.origin[4 * i + k] * in.axis[k];
  const Model<double> arm = arm_model(on_the_rail(in), &along);
  Model<double> model = arm;
  model.n = in.n;
  model.rail.mass = 0.0;
  for (double mass : in.mass) model.rail.mass += mass;
  model.joint[0] = Joint<double>{};
  model.joint[0].turn = Joint<double>::kParallel;
  model.joint[0].cos_alpha = 1.0;
  for (int i = 1; i < in.n; ++i) {
    model.joint[i] = arm.joint[i - 1];
    model.drive[i] = arm.drive[i - 1];
  }
  model.drive[0] = {in.rotor[0], in.viscous[0], in.coulomb[0], in.ratio[0], in.copper[0] / (in.ratio[0] * in.ratio[0])};
  if (arm.balance.joint >= 0) ++model.balance.joint;
  for (int i = 0; i < in.n; ++i)
    for (int j = 0; j < in.n; ++j) {
      model.coupling.turns[i][j] = in.turns[i * in.n + j];
      model.coupling.inverse[i][j] = in.inverse[i * in.n + j];
    }
  return model;
}

// along: of a rail under the arm, in the frame of link 0
Model<double> arm_model(const ChainInput& in, const Vec3* along) {  // long: one block per part of the model, with its checks
  Model<double> model;
  model.n = in.n;
  const Lines lines = joint_lines(in);
  const std::vector<Frame> frames = frames_of(lines);
  std::vector<Body> bodies;
  for (int i = 0; i < in.n; ++i) bodies.push_back(body_of(in, lines, i, frames[i]));
  for (int i = 0; i < in.n; ++i) {
    Joint<double>& j = model.joint[i];
    j.cos_alpha = 1.0;
    j.sin_alpha = j.theta0 = 0.0;
    Vec3 r{};
    if (i > 0) {
      const Frame &f = frames[i - 1], &g = frames[i];
      j.sin_alpha = tidy(dot(cross(f.z, g.z), f.x));
      j.cos_alpha = tidy(dot(f.z, g.z));
      const Mat3 to_before = transpose(f.axes());
      r = to_before * (g.o - f.o);
      const Vec3 x = to_before * g.x;  // = (cos theta, cos alpha sin theta, sin alpha sin theta)
      j.theta0 = ir::arc_tangent(j.cos_alpha * x[1] + j.sin_alpha * x[2], x[0]);
    }
    j.turn = j.sin_alpha == 0.0 && j.cos_alpha > 0.0 ? Joint<double>::kParallel
             : j.cos_alpha == 0.0                    ? Joint<double>::kPerpendicular
                                                     : Joint<double>::kAny;
    if (j.turn == Joint<double>::kPerpendicular) j.sin_alpha = j.sin_alpha > 0.0 ? 1.0 : -1.0;
    for (int k = 0; k < 3; ++k) {
      j.r[k] = tidy(r[k]);
      j.has[k] = j.r[k] != 0.0;
    }
    j.has_r = j.has[0] || j.has[1] || j.has[2];
    model.drive[i] = {in.rotor[i], in.viscous[i], in.coulomb[i], in.ratio[i],
                      in.copper[i] / (in.ratio[i] * in.ratio[i])};
  }
  for (int i = in.n - 1; i >= 0; --i) {
    const Body round = take_round_part(bodies[i]);
    Joint<double>& j = model.joint[i];
    const Mat3& I = bodies[i].inertia;
    j.hx = bodies[i].moment[0];
    j.hy = bodies[i].moment[1];
    j.xx = I[0][0];
    j.xy = I[0][1];
    j.xz = I[0][2];
    j.yz = I[1][2];
    j.zz = I[2][2];
    const double size = in.mass[i] + std::abs(j.zz);
    for (double* small : {&j.hx, &j.hy, &j.xy, &j.xz, &j.yz})
      if (std::abs(*small) < 1e-14 * size) *small = 0.0;
    j.has_hx = j.hx != 0.0;
    j.has_hy = j.hy != 0.0;
    j.products = j.xy != 0.0 || j.xz != 0.0 || j.yz != 0.0;
    if (i == 0) break;  // the round part of link 1 rides on the base
    const Mat3 to_before = transpose(frames[i - 1].axes());
    add(bodies[i - 1], seen_from(round, to_before * frames[i].axes(), to_before * (frames[i].o - frames[i - 1].o)));
  }
  const Vec3 lift = transpose(frames[0].axes()) * (-1.0 * in.gravity);
  for (int k = 0; k < 3; ++k) model.lift[k] = lift[k];
  if (along != nullptr) {
    const Vec3 direction = transpose(frames[0].axes()) * *along;
    model.rail.there = true;
    for (int k = 0; k < 3; ++k) model.rail.along[k] = tidy(direction[k]);
  }
  model.balance = balance_of(in, model.joint);
  for (int i = 0; i < in.n; ++i)
    for (int j = 0; j < in.n; ++j) {
      const double turns = in.turns[i * in.n + j];
      model.coupling.turns[i][j] = turns;
      model.coupling.inverse[i][j] = in.inverse[i * in.n + j];
      model.coupling.any |= turns != (i == j ? 1.0 : 0.0);
    }
  return model;
}

}  // namespace

Model<double> build_model(const ChainInput& in) {
  return in.first_slides ? model_with_rail(in) : arm_model(in, nullptr);
}

Model<float> to_single(const Model<double>& m) {
  Model<float> s;
  s.n = m.n;
  const auto f = [](double x) { return static_cast<float>(x); };
  for (int i = 0; i < m.n; ++i) {
    const Joint<double>& j = m.joint[i];
    s.joint[i] = {static_cast<Joint<float>::Turn>(j.turn), f(j.cos_alpha), f(j.sin_alpha),
                  {f(j.r[0]), f(j.r[1]), f(j.r[2])}, {j.has[0], j.has[1], j.has[2]}, j.has_r, f(j.theta0),
                  f(j.hx), f(j.hy), f(j.xx), f(j.xy), f(j.xz), f(j.yz), f(j.zz), j.has_hx, j.has_hy, j.products};
    const Drive<double>& d = m.drive[i];
    s.drive[i] = {f(d.rotor), f(d.viscous), f(d.coulomb), f(d.ratio), f(d.copper_at_joint)};
  }
  const Balance<double>& b = m.balance;
  s.balance.joint = b.joint;
  s.balance.lever_cos = f(b.lever_cos);
  s.balance.lever_sin = f(b.lever_sin);
  s.balance.square_cos = f(b.square_cos);
  s.balance.square_sin = f(b.square_sin);
  for (int k = 0; k < Balance<double>::kTerms; ++k) s.balance.coefficient[k] = f(b.coefficient[k]);
  for (int k = 0; k < 3; ++k) s.lift[k] = f(m.lift[k]);
  s.rail = {m.rail.there, {f(m.rail.along[0]), f(m.rail.along[1]), f(m.rail.along[2])}, f(m.rail.mass)};
  s.coupling.any = m.coupling.any;
  for (int i = 0; i < m.n; ++i)
    for (int j = 0; j < m.n; ++j) {
      s.coupling.turns[i][j] = f(m.coupling.turns[i][j]);
      s.coupling.inverse[i][j] = f(m.coupling.inverse[i][j]);
    }
  return s;
}

}  // namespace ir::dynamics
