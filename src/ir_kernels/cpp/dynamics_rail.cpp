// The recursions of an arm on a rail: those of the arm, whose base accelerates, for every kind of number in use.
#include "dynamics_adjoint.hpp"
#include "dynamics_numbers.hpp"
#include "dynamics_recursion.hpp"
#include "lanes.hpp"

namespace ir::dynamics {

template <class S, class T, class Trace>
void rail_newton_euler(const Model<T>& m, const S* sn, const S* cs, const S* qd, const S* qdd, S* tau, bool gravity,
                       Trace& trace) {
  const T on = gravity ? T(1) : T(0);
  const T* along = m.rail.along;
  const S zero = qd[1] * T(0);
  const Vector<S> lift{zero + m.lift[0] * on, zero + m.lift[1] * on, zero + m.lift[2] * on};
  const Vector<S> base{lift.x + qdd[0] * along[0], lift.y + qdd[0] * along[1], lift.z + qdd[0] * along[2]};
  Vector<S> push;
  arm_newton_euler<0, true>(m.joint + 1, m.n - 1, base, sn + 1, cs + 1, qd + 1, qdd + 1, tau + 1, &push, trace);
  const S weight = lift.x * along[0] + lift.y * along[1] + lift.z * along[2];
  tau[0] = push.x * along[0] + push.y * along[1] + push.z * along[2] + (qdd[0] + weight) * m.rail.mass;
}

template <class S, class T>
void rail_newton_euler_adjoint(const Model<T>& m, const S* sn, const S* cs, const S* qd, const LinkTrace<S>* link,
                               const S* u, S* by_q, S* by_qd, S* by_qdd) {
  const T* along = m.rail.along;
  Vector<S> of_base{u[0] * along[0], u[0] * along[1], u[0] * along[2]};
  arm_newton_euler_adjoint<0, true>(m.joint + 1, m.n - 1, sn + 1, cs + 1, qd + 1, link, u + 1, by_q + 1, by_qd + 1,
                                    by_qdd + 1, &of_base);
  by_qdd[0] = by_qdd[0] + (of_base.x * along[0] + of_base.y * along[1] + of_base.z * along[2]) + u[0] * m.rail.mass;
}

#define IR_RAIL(S, T, Trace)                                                                                        \
  template void rail_newton_euler<S, T, Trace>(const Model<T>&, const S*, const S*, const S*, const S*, S*, bool, \
                                               Trace&);
IR_RAIL(Doubles, double, NoTrace)
IR_RAIL(Floats, float, NoTrace)
IR_RAIL(Dual<Doubles>, double, NoTrace)
IR_RAIL(Interval, double, NoTrace)
IR_RAIL(Dual<Interval>, double, NoTrace)
IR_RAIL(Double8, double, Trace<Double8>)
template void rail_newton_euler_adjoint<Double8, double>(const Model<double>&, const Double8*, const Double8*,
                                                         const Double8*, const LinkTrace<Double8>*, const Double8*,
                                                         Double8*, Double8*, Double8*);

}  // namespace ir::dynamics
