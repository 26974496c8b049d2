/* heatrun export: the laws of thermal_network.h
 *
 * Each node:    C dT/dt = heat - flows out + flows in,  flow = g (T - T of the other end)
 * Copper loss:  Pjs = phases Rs0 I^2 (B + T)/(B + Tref), T of the copper node; k s^2 Pjs + g Pjs
 *               more by the speed and by another resistance, and what another B makes of it
 * Stray loss:   k' I^2 s^1.5, s speed over the rated one; in the copper node where losses hold all
 * Other losses: $other_words, shared to the nodes, a gain of them and a standby loss added; of them
 *               P s^n (1 - m + m i^2) to one node, not below 0, i current over the rated one: teeth
 *               in the winding, rotor; and k s^m of them outside
 * Locked rotor: s is 0.01 at least in what goes with the current
 * Overhang:     a share of the copper, with the loss of its own temperature
 * Bearings:     Tf omega exp(-kappa (T - sink))
 * Sink:         (1 - a) (sink + r times all losses) + a coolant
 * Surface:      g (1 - f + f ((theta^2 + 1)/40^2)^(n/2)), theta over the link; radiation
 * Insulation:   g (1 + b (T - 60)), T of the first end
 *
 * Classical Runge-Kutta in HEATRUN_PARTS equal parts of a step. The matrix of the network depends
 * on current and speed, so that an exact discretisation would need an exponential in every step.
 */
#include "thermal_network.h"

#define R(x) ((heatrun_real)(x))
#define HEATRUN_PARTS $parts
#define NUM_NODES HEATRUN_NUM_NODES
#define NUM_LINKS HEATRUN_NUM_LINKS
#define SINK NUM_NODES
#define COPPER $copper
#define IS_BALANCE $is_balance

static const int FIRST_END[NUM_LINKS] = {$first};
static const int SECOND_END[NUM_LINKS] = {$second};
static const heatrun_real COEFFICIENT_DEGC = R($coefficient);
static const heatrun_real REFERENCE_DEGC = R($reference);
static const heatrun_real COPPER_PER_OHM_K = R($copper_per_ohm); /* phases/(B + Tref) */
#if HEATRUN_HAS_SPEED
static const heatrun_real RATED_SPEED_RPM = R($rated_speed);
static const heatrun_real RATED_CURRENT_A = R($rated_current);
#endif

const heatrun_parameters heatrun_identified = {
$identified};

$intervals/* What stays the same during a step. */
typedef struct {
    const heatrun_parameters *parameters;
    heatrun_real copper_W_per_A2_K;
    heatrun_real copper_gain; /* by another resistance [1] */
    heatrun_real eddies;      /* by the speed, at the temperature of the resistance [1] */
    heatrun_real stray_W_per_A2;
    heatrun_real square_A2; /* of the current */
    heatrun_real losses_W;
    heatrun_real copper_in_losses; /* 1 where losses_W holds the copper loss, else 0 */
    heatrun_real outside; /* share of the other losses [1] */
    heatrun_real friction_W[NUM_NODES]; /* of cold bearings */
    heatrun_real sinks_degC[2];
    heatrun_real recirculation_K_per_W;
    heatrun_real heat_W[NUM_NODES];
    heatrun_real conductance_W_per_K[NUM_LINKS];
} drive;

/* False for NaN. */
static int is_within(heatrun_real value, heatrun_real low, heatrun_real high)
{
    return value >= low && value <= high;
}

static int is_temperature(heatrun_real value)
{
    return is_within(value, R(HEATRUN_MIN_DEGC), R(HEATRUN_MAX_DEGC));
}

static int is_valid(const heatrun_inputs *inputs)
{
    int valid = is_within(inputs->current_A, R(-HEATRUN_MAX_CURRENT_A), R(HEATRUN_MAX_CURRENT_A))
        && is_within(inputs->losses_W, R(-HEATRUN_MAX_LOSSES_W), R(HEATRUN_MAX_LOSSES_W))
        && is_temperature(inputs->sink_degC);
#if HEATRUN_HAS_SECOND_SINK
    valid = valid && is_temperature(inputs->second_sink_degC);
#endif
#if HEATRUN_HAS_COOLANT
    valid = valid && is_temperature(inputs->coolant_degC);
#endif
#if HEATRUN_HAS_SPEED
    valid = valid
        && is_within(inputs->speed_rpm, R(-HEATRUN_MAX_SPEED_RPM), R(HEATRUN_MAX_SPEED_RPM));
#endif
#if HEATRUN_HAS_FAN
    valid = valid && is_within(inputs->fan, R(0.0), R(1.0));
#endif
    return valid;
}

#if HEATRUN_HAS_SPEED || HEATRUN_HAS_WARMTH
/* exp(x) to the last digits of the type: its series, after powers of two are taken out. */
static heatrun_real exponential(heatrun_real x)
{
    const heatrun_real ln2 = R(0.69314718055994530942);
    const int twos = is_within(x, R(-700.0), R(700.0)) /* else the nearest end */
        ? (int)(x/ln2 + (x < R(0.0) ? R(-0.5) : R(0.5)))
        : x < R(0.0) ? -1000 : 1000;
    const heatrun_real rest = is_within(x, R(-700.0), R(700.0)) ? x - R(twos)*ln2 : R(0.0);
    heatrun_real result = R(1.0);
    int i;
    for (i = 14; i >= 1; --i) {
        result = R(1.0) + rest/R(i)*result;
    }
    for (i = 0; i < twos; ++i) {
        result *= R(2.0);
    }
    for (i = 0; i > twos; --i) {
        result *= R(0.5);
    }
    return result;
}

/* base^exponent for base >= 0 and an exponent from 0 to 8: logarithm and exponential by their
 * series, after powers of two are taken out. */
static heatrun_real power(heatrun_real base, heatrun_real exponent)
{
    heatrun_real y, square, logarithm = R(0.0);
    int twos = 0;
    int i;
    if (!(base > R(1e-15))) {
        return R(0.0);
    }
    for (i = 0; i < 64 && base > R(1.5); ++i) {
        base *= R(0.5);
        ++twos;
    }
    for (i = 0; i < 64 && base < R(0.75); ++i) {
        base *= R(2.0);
        --twos;
    }
    y = (base - R(1.0))/(base + R(1.0)); /* within 0.2 */
    square = y*y;
    for (i = 23; i >= 1; i -= 2) {
        logarithm = logarithm*square + R(2.0)/R(i);
    }
    return exponential(exponent*(logarithm*y + R(twos)*R(0.69314718055994530942)));
}
#endif

static void prepare(const heatrun_parameters *p, const heatrun_inputs *inputs, drive *at)
{
    int i;
#if HEATRUN_HAS_SPEED
    const heatrun_real speed =
        inputs->speed_rpm < R(0.0) ? -inputs->speed_rpm : inputs->speed_rpm;
    const heatrun_real rated = speed/RATED_SPEED_RPM;
    const heatrun_real turning = rated > R(0.01) ? rated : R(0.01);
    const heatrun_real load =
        inputs->current_A*inputs->current_A/(RATED_CURRENT_A*RATED_CURRENT_A);
    heatrun_real moved_W = R(0.0);
#endif
    at->parameters = p;
    at->square_A2 = inputs->current_A*inputs->current_A;
    at->copper_W_per_A2_K = COPPER_PER_OHM_K*p->Rs0_ohm;
    at->copper_gain = p->resistance_gain;
    at->stray_W_per_A2 = R(0.0);
    at->outside = R(0.0);
#if HEATRUN_HAS_SPEED
    at->eddies = p->ac_copper*rated*rated;
    if (p->stray_W > R(0.0)) {
        at->stray_W_per_A2 =
            p->stray_W/(RATED_CURRENT_A*RATED_CURRENT_A)*power(turning, R(1.5));
    }
    if (p->outside_share > R(0.0) && rated > R(0.0)) {
        at->outside = p->outside_share*power(rated, p->outside_exponent);
    }
#else
    at->eddies = R(0.0);
#endif
    at->losses_W = inputs->losses_W;
    at->copper_in_losses = R(IS_BALANCE);
    at->sinks_degC[0] = inputs->sink_degC;
    at->recirculation_K_per_W = p->recirculation_K_per_W;
#if HEATRUN_HAS_COOLANT
    at->recirculation_K_per_W *= R(1.0) - p->coolant_share;
    at->sinks_degC[0] += p->coolant_share*(inputs->coolant_degC - inputs->sink_degC);
#endif
#if HEATRUN_HAS_SECOND_SINK
    at->sinks_degC[1] = inputs->second_sink_degC;
#else
    at->sinks_degC[1] = R(0.0);
#endif
    for (i = 0; i < NUM_LINKS; ++i) {
        heatrun_real g = R(1.0)/p->resistance_K_per_W[i];
#if HEATRUN_HAS_SPEED
        if (p->speed_gain[i] > R(0.0)) {
            g *= R(1.0) + p->speed_gain[i]*power(rated, p->speed_exponent[i]);
        }
#endif
#if HEATRUN_HAS_FAN
        g *= R(1.0) + p->fan_gain[i]*inputs->fan;
#endif
        at->conductance_W_per_K[i] = g;
    }
    for (i = 0; i < NUM_NODES; ++i) {
#if HEATRUN_HAS_SPEED
        const heatrun_real rate = speed/R(1000.0);
        at->friction_W[i] = p->friction_Nm[i]*speed*R(0.10471975511965977462);
        at->heat_W[i] = (p->speed_loss_W[i] + p->speed_squared_loss_W[i]*rate)*rate;
#if IS_BALANCE
        at->losses_W -= at->heat_W[i];
#endif
#else
        at->friction_W[i] = R(0.0);
        at->heat_W[i] = R(0.0);
#endif
    }
#if HEATRUN_HAS_SPEED
    for (i = 0; i < NUM_NODES; ++i) {
        const heatrun_real m = p->moved_by_load[i];
        if (p->moved_W[i] > R(0.0)) {
            const heatrun_real share = (R(1.0) - m)*power(rated, p->moved_exponent[i])
                + m*load*power(turning, p->moved_exponent[i]);
            if (share > R(0.0)) {
                at->heat_W[i] += p->moved_W[i]*share;
                moved_W += p->moved_W[i]*share;
            }
        }
    }
    for (i = 0; i < NUM_NODES; ++i) {
        at->heat_W[i] -= p->share[i]*moved_W;
    }
#endif
}

/* Pjs of copper at a temperature, as the phase resistance and the material say. */
static heatrun_real direct(const drive *at, heatrun_real T_degC)
{
    return at->square_A2*at->copper_W_per_A2_K*(COEFFICIENT_DEGC + T_degC);
}

/* All that the copper gains, with the stray loss where that counts as such. */
static heatrun_real copper(const drive *at, const heatrun_real T[NUM_NODES])
{
    const heatrun_real more_degC = at->parameters->coefficient_more_degC;
    const heatrun_real by_B = more_degC/(COEFFICIENT_DEGC + more_degC + REFERENCE_DEGC)
        *(REFERENCE_DEGC - T[COPPER]);
    const heatrun_real risen =
        (COEFFICIENT_DEGC + T[COPPER])/(COEFFICIENT_DEGC + REFERENCE_DEGC);
    heatrun_real warmer_K = R(0.0);
    int i;
    for (i = 0; i < NUM_NODES; ++i) {
        warmer_K += at->parameters->copper_moved[i]*(T[i] - T[COPPER]);
    }
    return direct(at, T[COPPER])*(R(1.0) + at->copper_gain + at->eddies/(risen*risen))
        + at->square_A2*(at->copper_W_per_A2_K*(by_B + warmer_K)
                         + R(IS_BALANCE)*at->stray_W_per_A2);
}

/* The sink, with what the losses warm it. */
static heatrun_real sink(const drive *at, const heatrun_real T[NUM_NODES])
{
    const heatrun_real all_W = at->losses_W + (R(1.0) - at->copper_in_losses)*direct(at, T[COPPER]);
    return at->sinks_degC[0] + at->recirculation_K_per_W*all_W;
}

static void heats(const drive *at, const heatrun_real T[NUM_NODES], heatrun_real W[NUM_NODES])
{
    const heatrun_parameters *p = at->parameters;
    const heatrun_real copper_W = copper(at, T);
    const heatrun_real direct_W = direct(at, T[COPPER]);
    const heatrun_real channel_W =
        at->losses_W + (R(IS_BALANCE) - at->copper_in_losses)*direct_W;
    const heatrun_real other_W = at->losses_W - at->copper_in_losses*copper_W
        + p->loss_gain*channel_W + p->standby_W
        - at->outside*(at->losses_W - at->copper_in_losses*direct_W)
        + R(1 - IS_BALANCE)*at->stray_W_per_A2*at->square_A2;
    heatrun_real left_W = copper_W;
    int i;
    for (i = 0; i < NUM_NODES; ++i) {
        const heatrun_real moved_W = p->copper_moved[i]*direct(at, T[i]);
        W[i] = at->heat_W[i] + p->share[i]*other_W + moved_W;
#if HEATRUN_HAS_SPEED
        if (at->friction_W[i] > R(0.0)) {
            W[i] += at->friction_W[i]*exponential(-p->friction_fall_per_K[i]*(T[i] - sink(at, T)));
        }
#endif
        left_W -= moved_W;
    }
    W[COPPER] += left_W;
}

#if HEATRUN_HAS_WARMTH
/* What a conductance is multiplied with for the temperatures at its ends. */
static heatrun_real by_warmth(const heatrun_parameters *p, int link, heatrun_real near_degC,
                              heatrun_real far_degC)
{
    const heatrun_real theta_K = near_degC - far_degC;
    heatrun_real gain = R(1.0) + p->warmth_gain_per_K[link]*(near_degC - R(60.0));
    if (p->natural_share[link] > R(0.0)) {
        const heatrun_real ratio = power((theta_K*theta_K + R(1.0))/R(1600.0),
                                         R(0.5)*p->natural_exponent[link]);
        gain *= R(1.0) + p->natural_share[link]*(ratio - R(1.0));
    }
    return gain;
}

/* Heat that a surface of 1 m2 radiates [W]. */
static heatrun_real radiated(heatrun_real hot_degC, heatrun_real cold_degC)
{
    const heatrun_real hot_K = hot_degC + R(273.15), cold_K = cold_degC + R(273.15);
    return R(5.670374419e-8)*(hot_K*hot_K + cold_K*cold_K)*(hot_K + cold_K)*(hot_K - cold_K);
}
#endif

static void slopes(const drive *at, const heatrun_real T[NUM_NODES],
                   heatrun_real K_per_s[NUM_NODES])
{
    const heatrun_real sinks_degC[2] = {sink(at, T), at->sinks_degC[1]};
    int i;
    heats(at, T, K_per_s);
    for (i = 0; i < NUM_LINKS; ++i) {
        const int end = SECOND_END[i];
        const heatrun_real far = end < NUM_NODES ? T[end] : sinks_degC[end - SINK];
        heatrun_real flow = at->conductance_W_per_K[i]*(T[FIRST_END[i]] - far);
#if HEATRUN_HAS_WARMTH
        flow *= by_warmth(at->parameters, i, T[FIRST_END[i]], far);
#endif
        K_per_s[FIRST_END[i]] -= flow;
        if (end < NUM_NODES) {
            K_per_s[end] += flow;
        }
    }
    for (i = 0; i < NUM_NODES; ++i) {
#if HEATRUN_HAS_WARMTH
        K_per_s[i] -= at->parameters->radiating_m2[i]*radiated(T[i], sinks_degC[0]);
#endif
        K_per_s[i] /= at->parameters->capacitance_J_per_K[i];
    }
}

/* Increments are summed with what was rounded off before (Kahan): in float too, an error does not
 * grow with the number of steps. */
static void advance(const drive *at, heatrun_state *state, heatrun_real step_s)
{
    static const heatrun_real REACH[4] = {R(0.0), R(0.5), R(0.5), R(1.0)};
    static const heatrun_real WEIGHT[4] = {R(1.0), R(2.0), R(2.0), R(1.0)};
    const heatrun_real h = step_s/R(HEATRUN_PARTS);
    int part, stage, i;
    for (part = 0; part < HEATRUN_PARTS; ++part) {
        heatrun_real slope[NUM_NODES] = {R(0.0)};
        heatrun_real sum[NUM_NODES] = {R(0.0)};
        heatrun_real T[NUM_NODES];
        for (stage = 0; stage < 4; ++stage) {
            for (i = 0; i < NUM_NODES; ++i) {
                T[i] = state->temperature_degC[i] + REACH[stage]*h*slope[i];
            }
            slopes(at, T, slope);
            for (i = 0; i < NUM_NODES; ++i) {
                sum[i] += WEIGHT[stage]*slope[i];
            }
        }
        for (i = 0; i < NUM_NODES; ++i) {
            const heatrun_real change = h*sum[i]/R(6.0) - state->carry_K[i];
            const heatrun_real before = state->temperature_degC[i];
            const heatrun_real after = before + change;
            state->carry_K[i] = (after - before) - change;
            state->temperature_degC[i] = after;
        }
    }
}

heatrun_status heatrun_start(heatrun_state *state,
                             const heatrun_real temperature_degC[HEATRUN_NUM_NODES])
{
    int i;
    for (i = 0; i < NUM_NODES; ++i) {
        if (!is_temperature(temperature_degC[i])) {
            return HEATRUN_STATE_INVALID;
        }
    }
    for (i = 0; i < NUM_NODES; ++i) {
        state->temperature_degC[i] = temperature_degC[i];
        state->carry_K[i] = R(0.0);
    }
    state->parameters = &heatrun_identified;
    return HEATRUN_OK;
}

#if HEATRUN_HAS_RESISTANCE
const heatrun_winding heatrun_cold_winding = {$cold};

heatrun_real heatrun_winding_degC(const heatrun_winding *winding, heatrun_real resistance_ohm)
{
    const heatrun_real B = winding->coefficient_degC;
    const heatrun_real ratio = (resistance_ohm - winding->lead_ohm)/winding->cold_ohm;
    const heatrun_real found_degC = ratio*(B + winding->cold_degC) - B;
    return winding->cold_ohm > R(0.0) && ratio > R(0.0) && is_temperature(found_degC)
        ? found_degC : R(HEATRUN_NO_READING_DEGC);
}
#endif

/* Advance with more heat in each node [W]; a null pointer stands for none. */
static heatrun_status step_with(heatrun_state *state, const heatrun_inputs *inputs, drive *at,
                                const heatrun_real *more_W, heatrun_real step_s)
{
    heatrun_state next = *state;
    int i;
    if (!is_valid(inputs)) {
        return HEATRUN_INPUT_INVALID;
    }
    prepare(state->parameters, inputs, at);
    for (i = 0; more_W && i < NUM_NODES; ++i) {
        at->heat_W[i] += more_W[i];
    }
    advance(at, &next, step_s);
    for (i = 0; i < NUM_NODES; ++i) {
        if (!is_temperature(next.temperature_degC[i])) {
            return HEATRUN_STATE_INVALID;
        }
    }
    *state = next;
    return HEATRUN_OK;
}

heatrun_status heatrun_step(heatrun_state *state, const heatrun_inputs *inputs)
{
    return heatrun_step_of(state, inputs, R(HEATRUN_STEP_S));
}

heatrun_status heatrun_step_of(heatrun_state *state, const heatrun_inputs *inputs,
                               heatrun_real step_s)
{
    drive at;
    return is_within(step_s, R(0.0), R(HEATRUN_STEP_S))
        ? step_with(state, inputs, &at, (const heatrun_real *)0, step_s)
        : HEATRUN_INPUT_INVALID;
}

/* Number of steps until a node is above a limit, num_steps if it stays below. */
static long steps_below(const heatrun_state *state, const drive *at, int node,
                        heatrun_real limit_degC, long num_steps)
{
    heatrun_state next = *state;
    long step;
    for (step = 0; step < num_steps && next.temperature_degC[node] <= limit_degC; ++step) {
        advance(at, &next, R(HEATRUN_STEP_S));
    }
    return next.temperature_degC[node] <= limit_degC ? num_steps : step;
}

static int is_question(const heatrun_inputs *inputs, int node, heatrun_real limit_degC,
                       heatrun_real horizon_s)
{
    return is_valid(inputs) && node >= 0 && node < NUM_NODES && is_temperature(limit_degC)
        && is_within(horizon_s, R(0.0), R(HEATRUN_MAX_STEPS)*R(HEATRUN_STEP_S));
}

heatrun_real heatrun_time_to_limit_s(const heatrun_state *state, const heatrun_inputs *inputs,
                                     int node, heatrun_real limit_degC, heatrun_real horizon_s)
{
    drive at;
    long num_steps, steps;
    if (!is_question(inputs, node, limit_degC, horizon_s)) {
        return R(-1.0);
    }
    prepare(state->parameters, inputs, &at);
    num_steps = (long)(horizon_s/R(HEATRUN_STEP_S) + R(0.001));
    steps = steps_below(state, &at, node, limit_degC, num_steps);
    return steps == num_steps ? horizon_s : R(steps)*R(HEATRUN_STEP_S);
}

heatrun_real heatrun_permitted_current_A(const heatrun_state *state, const heatrun_inputs *inputs,
                                         int node, heatrun_real limit_degC,
                                         heatrun_real horizon_s)
{
    heatrun_real low_A = R(0.0), high_A = R(HEATRUN_MAX_CURRENT_A);
    drive at;
    long num_steps;
    int i;
    if (!is_question(inputs, node, limit_degC, horizon_s)
        || !(state->parameters->Rs0_ohm > R(0.0))) {
        return R(-1.0);
    }
    prepare(state->parameters, inputs, &at);
    num_steps = (long)(horizon_s/R(HEATRUN_STEP_S) + R(0.001));
    if (num_steps < 1) {
        return R(-1.0);
    }
    at.losses_W -= at.copper_in_losses*copper(&at, state->temperature_degC);
    at.copper_in_losses = R(0.0);
    at.square_A2 = high_A*high_A;
    if (steps_below(state, &at, node, limit_degC, num_steps) == num_steps) {
        return high_A;
    }
    for (i = 0; i < 20; ++i) { /* to a millionth of the largest current */
        const heatrun_real middle_A = R(0.5)*(low_A + high_A);
        at.square_A2 = middle_A*middle_A;
        if (steps_below(state, &at, node, limit_degC, num_steps) == num_steps) {
            low_A = middle_A;
        } else {
            high_A = middle_A;
        }
    }
    return low_A;
}
