
/* Observer. Its states: the temperatures; heat that the network misses, on each heated node a
 * Gauss-Markov process with the size and the time of the run; a slow error of the readings, another
 * such process; what a sensor that lags shows. With white noise on top, the innovations of a sound
 * sensor are white. Four errors stay as they are: of the sensor; of the sink; of the heat, all as a
 * share and the losses that are passed; and of the parameters, in the direction that the run tells
 * least of, by which nodes that it did not read are off beside one that it did. Sink and heat are
 * as wide as the parameters leave the temperatures open otherwise. No record tells them apart, so
 * they count in the covariance and are not estimated (S. F. Schmidt 1966). */
#define NUM_HEATS HEATRUN_NUM_HEATS
#define NUM_STATES HEATRUN_NUM_STATES
#define SLOW (NUM_NODES + NUM_HEATS)
#define CONSTANT (SLOW + 1 + HEATRUN_HAS_LAG) /* the first of them: sensor, sink, heat, path */
#define SINK_ERROR (CONSTANT + 1)
#define HEAT_ERROR (CONSTANT + 2)
#define PATH_ERROR (CONSTANT + 3)
#define SENSED $sensed
#define MOST_SD_K 300.0 /* a node that is known no better is not known */
#if HEATRUN_HAS_LAG
#define SHOWN (SLOW + 1) /* the state that is read */
static const heatrun_real LAG_DECAY = R($lag_decay); /* over a step */
static const heatrun_real LAG_MEAN = R($lag_mean);   /* of that over a step */
static const heatrun_real PART[NUM_NODES] = {$reading}; /* of each node in the reading */

/* Where the sensor sits, between its node and the overhang. */
static heatrun_real sensed(const heatrun_real T[NUM_NODES])
{
    heatrun_real sum = R(0.0);
    int i;
    for (i = 0; i < NUM_NODES; ++i) {
        sum += PART[i]*T[i];
    }
    return sum;
}
#else
#define SHOWN SENSED /* the node that is read */
#endif

static const int HEATED[NUM_HEATS] = {$heated};
static const heatrun_real HEAT_SD_W = R($heat_sd);
static const heatrun_real HEAT_DECAY = R($heat_decay); /* over a step */
static const heatrun_real SLOW_DECAY = R($slow_decay);
static const heatrun_real SINK_SD_K = R($sink_sd);
static const heatrun_real SHARE_SD = R($share_sd);
static const heatrun_real LOSSES_SD = R($losses_sd);
static const heatrun_real HEAT_ERROR_SD = R($heat_error_sd); /* of both */
static const heatrun_real LOSSES_PART = R($losses_part); /* of the losses in its square */
static const heatrun_real ERRORS_W = R($errors); /* heat that errors of sensor and sink look like */
static const heatrun_real BLIND_K = R($blind); /* growth in a step without inputs */
static const heatrun_real ANSWER_SD = R($answer_sd); /* of a fresh change, over that change */
static const heatrun_real MISFIT_SD_K = R($misfit_sd); /* of the network, with the slow noise */
static const heatrun_real LATE_DECAY = R($late_decay); /* of what a sensor that lags has not shown */
static const heatrun_real ANSWER_DECAY = R($answer_decay); /* with the time of the sensed node */

/* The parameters of the run, one sd off in the direction that it tells least of. */
static const heatrun_parameters ASIDE = {
$aside};

/* Place of a covariance in the lower triangle, whose rows are no longer than the first constant:
 * constants stay independent, with their variances. */
static int place(int i, int j)
{
    const int row = i < j ? j : i;
    const int column = i < j ? i : j;
    return (row < CONSTANT ? row*(row + 1)/2 : CONSTANT*(CONSTANT + 1)/2 + (row - CONSTANT)*CONSTANT)
        + column;
}

/* Square root by Newton's method, after powers of four are taken out; 0 for NaN. */
static heatrun_real root(heatrun_real square)
{
    heatrun_real scale = R(1.0), y = R(1.0);
    int i;
    if (!(square > R(1e-30))) {
        return R(0.0);
    }
    for (i = 0; i < 64 && square > R(2.0); ++i) {
        square *= R(0.25);
        scale *= R(2.0);
    }
    for (i = 0; i < 64 && square < R(0.5); ++i) {
        square *= R(4.0);
        scale *= R(0.5);
    }
    for (i = 0; i < 6; ++i) {
        y = R(0.5)*(y + square/y);
    }
    return scale*y;
}

/* Variance of a state other than a temperature that nothing is known of. */
static heatrun_real start_variance(int i)
{
    const heatrun_real sd = i < SLOW ? HEAT_SD_W
        : i == SLOW                  ? R(HEATRUN_SLOW_SD_K)
        : i == CONSTANT              ? R(HEATRUN_SENSOR_SD_K)
        : i == SINK_ERROR            ? SINK_SD_K
        : i == HEAT_ERROR            ? HEAT_ERROR_SD
        : i == PATH_ERROR            ? R(1.0)
                                     : R(0.0);
    return sd*sd;
}

static heatrun_real covariance(const heatrun_observer *observer, int i, int j)
{
    return i < CONSTANT || j < CONSTANT ? observer->covariance[place(i, j)]
        : i == j                        ? start_variance(i)
                                        : R(0.0);
}

/* The network near its temperatures: what a kelvin more of each node, and then of the sinks, adds
 * to the slope of every node [1/s]; and what parameters that are aside add [K/s]. */
static void slopes_near(const drive *at, const heatrun_inputs *inputs,
                        const heatrun_real T[NUM_NODES],
                        heatrun_real per_s[NUM_NODES + 2][NUM_NODES])
{
    heatrun_real now[NUM_NODES];
    drive other;
    int i, j;
    slopes(at, T, now);
    for (j = 0; j <= NUM_NODES; ++j) {
        drive changed = *at;
        heatrun_real there[NUM_NODES];
        for (i = 0; i < NUM_NODES; ++i) {
            there[i] = T[i] + (i == j ? R(1.0) : R(0.0));
        }
        if (j == NUM_NODES) {
            changed.sinks_degC[0] += R(1.0);
            changed.sinks_degC[1] += R(1.0);
        }
        slopes(&changed, there, per_s[j]);
        for (i = 0; i < NUM_NODES; ++i) {
            per_s[j][i] -= now[i];
        }
    }
    prepare(&heatrun_identified, inputs, &other);
    slopes(&other, T, now);
    prepare(&ASIDE, inputs, &other);
    slopes(&other, T, per_s[NUM_NODES + 1]);
    for (i = 0; i < NUM_NODES; ++i) {
        per_s[NUM_NODES + 1][i] -= now[i];
    }
}

/* Column of F: what becomes of a state of 1 in a step. */
static void passed(const drive *at, heatrun_real per_s[NUM_NODES + 2][NUM_NODES],
                   const heatrun_real now_W[NUM_NODES], int j, heatrun_real column[NUM_STATES])
{
    const heatrun_parameters *p = at->parameters;
    const heatrun_real h = R(HEATRUN_STEP_S)/R(HEATRUN_PARTS);
    heatrun_real push[NUM_NODES]; /* slopes that are held [K/s] */
    int i, k, part, order;
    for (i = 0; i < NUM_STATES; ++i) {
        column[i] = R(0.0);
    }
    column[j] = j < SLOW ? HEAT_DECAY : j == SLOW ? SLOW_DECAY : R(1.0);
    for (i = 0; i < NUM_NODES; ++i) {
        const heatrun_real C = p->capacitance_J_per_K[i];
        push[i] = j == SINK_ERROR ? per_s[NUM_NODES][i]
            : j == PATH_ERROR     ? per_s[NUM_NODES + 1][i]
            : j == HEAT_ERROR
            ? (now_W[i] + LOSSES_PART*(p->share[i]*at->losses_W - now_W[i]))/C
            : j >= NUM_NODES && j < SLOW && HEATED[j - NUM_NODES] == i ? R(1.0)/C
                                                                      : R(0.0);
        column[i] = i == j ? R(1.0) : R(0.0);
    }
    for (part = 0; part < HEATRUN_PARTS; ++part) {
        heatrun_real term[NUM_NODES], next[NUM_NODES];
        for (i = 0; i < NUM_NODES; ++i) {
            term[i] = column[i];
        }
        for (order = 1; order <= 4; ++order) { /* as Runge-Kutta of a linear network */
            for (i = 0; i < NUM_NODES; ++i) {
                next[i] = order == 1 ? push[i] : R(0.0);
                for (k = 0; k < NUM_NODES; ++k) {
                    next[i] += per_s[k][i]*term[k];
                }
            }
            for (i = 0; i < NUM_NODES; ++i) {
                term[i] = h/R(order)*next[i];
                column[i] += term[i];
            }
        }
    }
#if HEATRUN_HAS_LAG
    column[SHOWN] = (R(1.0) - LAG_MEAN)*sensed(column) /* exact for a straight course */
        + (j < NUM_NODES ? PART[j]*(LAG_MEAN - LAG_DECAY) : R(0.0))
        + (j == SHOWN ? LAG_DECAY : R(0.0));
#endif
}

/* P -> F P F' + Q; F stands by columns. */
static void predict_covariance(heatrun_observer *observer, const drive *at,
                               const heatrun_inputs *inputs, const heatrun_real now_W[NUM_NODES])
{
    heatrun_real F[NUM_STATES][NUM_STATES];
    heatrun_real product[NUM_STATES][NUM_STATES];
    heatrun_real per_s[NUM_NODES + 2][NUM_NODES];
    int i, j, k;
    slopes_near(at, inputs, observer->model.temperature_degC, per_s);
    for (j = 0; j < NUM_STATES; ++j) {
        passed(at, per_s, now_W, j, F[j]);
    }
    for (i = 0; i < NUM_STATES; ++i) {
        for (j = 0; j < NUM_STATES; ++j) {
            product[i][j] = R(0.0);
            for (k = 0; k < NUM_STATES; ++k) {
                product[i][j] += F[k][i]*covariance(observer, k, j);
            }
        }
    }
    for (i = 0; i < NUM_STATES; ++i) {
        for (j = 0; j <= i && j < CONSTANT; ++j) {
            heatrun_real sum = R(0.0);
            for (k = 0; k < NUM_STATES; ++k) {
                sum += product[i][k]*F[k][j];
            }
            observer->covariance[place(i, j)] = sum;
        }
        if (i >= NUM_NODES && i <= SLOW) {
            observer->covariance[place(i, i)] += start_variance(i)*(R(1.0) - F[i][i]*F[i][i]);
        }
    }
}

/* The standard deviation of each node grows by some kelvin. */
static void widen(heatrun_observer *observer, heatrun_real more_K)
{
    int i;
    for (i = 0; i < NUM_NODES; ++i) {
        const heatrun_real sd_K = root(covariance(observer, i, i));
        observer->covariance[place(i, i)] += (R(2.0)*sd_K + more_K)*more_K;
    }
}

/* Variance of a reading by its moment while the model moves: inputs may show a change of load
 * later or earlier than the reading does. */
static heatrun_real by_moment(heatrun_real change_K)
{
    const heatrun_real moment_K = R(HEATRUN_MOMENT_STEPS)*change_K;
    return moment_K*moment_K;
}

static int is_beyond(heatrun_real apart_K, heatrun_real variance_K2)
{
    return apart_K*apart_K > R(HEATRUN_OFF_SDS)*R(HEATRUN_OFF_SDS)*variance_K2;
}

/* Covariance of each state with the next reading, and the variance of that, white noise included. */
static heatrun_real foreseen(const heatrun_observer *observer, heatrun_real seen[NUM_STATES])
{
    int i;
    for (i = 0; i < NUM_STATES; ++i) {
        seen[i] = covariance(observer, i, SHOWN) + covariance(observer, i, SLOW)
            + covariance(observer, i, CONSTANT);
    }
    return seen[SHOWN] + seen[SLOW] + seen[CONSTANT] + by_moment(observer->change_K)
        + R(HEATRUN_READING_SD_K)*R(HEATRUN_READING_SD_K);
}

/* What the sensor shows without its errors. */
static heatrun_real shown(const heatrun_observer *observer)
{
#if HEATRUN_HAS_LAG
    return observer->shown_degC;
#else
    return observer->model.temperature_degC[SHOWN];
#endif
}

static heatrun_real size(heatrun_real x)
{
    return x < R(0.0) ? -x : x;
}

static void correct(heatrun_observer *observer, heatrun_real innovation_K)
{
    heatrun_real seen[NUM_STATES];
    const heatrun_real variance_K2 = foreseen(observer, seen);
    int i, j;
    for (i = 0; i < NUM_STATES; ++i) {
        const heatrun_real change = seen[i]/variance_K2*innovation_K;
        if (i < NUM_NODES) {
            observer->model.temperature_degC[i] += change;
        } else if (i < SLOW) {
            observer->heat_W[i - NUM_NODES] += change;
        } else if (i == SLOW) {
            observer->slow_K += change;
        }
#if HEATRUN_HAS_LAG
        else if (i == SHOWN) {
            observer->shown_degC += change;
        }
#endif
        for (j = 0; j <= (i < CONSTANT ? i : CONSTANT - 1); ++j) {
            observer->covariance[place(i, j)] -= seen[i]*seen[j]/variance_K2;
        }
        if (i < CONSTANT && !(covariance(observer, i, i) > R(0.0))) {
            observer->covariance[place(i, i)] = R(0.0); /* rounding */
        }
    }
}

/* Standard deviation of what may be wrong with the heat of a node [W]. */
static heatrun_real heat_sd(const drive *at, const heatrun_real now_W[NUM_NODES], int i)
{
    const heatrun_real share_W = SHARE_SD*now_W[i];
    const heatrun_real losses_W = LOSSES_SD*at->parameters->share[i]*at->losses_W;
    return root(HEAT_SD_W*HEAT_SD_W + share_W*share_W + losses_W*losses_W);
}

/* Whether the filter follows the sensor by heat that nothing accounts for. */
static int is_forced(const heatrun_observer *observer, const drive *at,
                     const heatrun_real now_W[NUM_NODES])
{
    int forced = 0;
    int i;
    for (i = 0; i < NUM_HEATS; ++i) {
        const heatrun_real sd_W = heat_sd(at, now_W, HEATED[i]) + ERRORS_W;
        forced = forced
            || !is_within(observer->heat_W[i], -R(HEATRUN_HEAT_SDS)*sd_W, R(HEATRUN_HEAT_SDS)*sd_W);
    }
    return forced;
}

/* Whether jumps explain how far the sensor is from the model: then it is the sensor that errs. */
static int has_jumped(const heatrun_observer *observer)
{
    return size(observer->jumped_K) > R(0.0)
        && R(2.0)*size(observer->jumped_K) >= size(observer->apart_K);
}

/* Moving means of x, and of how it goes with what a sensor that lags has not shown. */
static heatrun_real followed(heatrun_followed *of, heatrun_real x, heatrun_real late_K,
                             heatrun_real rate)
{
    of->with_late = (R(1.0) - rate)*(of->with_late + rate*late_K*(x - of->mean));
    of->mean += rate*(x - of->mean);
    return of->with_late;
}

/* Whether the sensor has been followed for long without need: by the mean of what readings and
 * model differ by, or as that goes with what a sensor that lags has not shown. Noise is averaged
 * away; for the latter errors that stay count by as much as they differ meanwhile. */
static int is_astray(heatrun_observer *observer, heatrun_real apart_K, heatrun_real stays_K2)
{
    const int num = observer->num_good < HEATRUN_MEAN_STEPS ? observer->num_good + 1
                                                            : HEATRUN_MEAN_STEPS;
    const heatrun_real rate = R(1.0)/R(num);
    const heatrun_real slow_share = rate/(rate + R(1.0) - SLOW_DECAY);
    const heatrun_real noise_K2 = rate*R(HEATRUN_READING_SD_K)*R(HEATRUN_READING_SD_K)
        + slow_share*R(HEATRUN_SLOW_SD_K)*R(HEATRUN_SLOW_SD_K);
    const heatrun_real misfit_K2 = slow_share*MISFIT_SD_K*MISFIT_SD_K;
    const heatrun_real late_K = observer->late_K - observer->late.mean;
    const heatrun_real late_K2 = followed(&observer->late, observer->late_K, late_K, rate);
    const heatrun_real apart_K2 = followed(&observer->apart, apart_K, late_K, rate);
    const heatrun_real prompt_K2 = followed(&observer->prompt, ANSWER_SD*observer->fresh_K
        + R(HEATRUN_MOMENT_STEPS)*observer->change_K, late_K, rate);
    const heatrun_real stays_late_K2 = followed(&observer->stays, root(stays_K2), late_K, rate);
    observer->mean_K2 += rate*((stays_K2 > R(0.0) ? stays_K2 : R(0.0)) - observer->mean_K2);
    return is_beyond(observer->apart.mean, observer->mean_K2 + noise_K2)
        || (apart_K2 < R(0.0)
            && is_beyond(apart_K2, late_K2*(noise_K2 + misfit_K2) + prompt_K2*prompt_K2
                                       + stays_late_K2*stays_late_K2));
}

/* Nothing has been followed yet. */
static void forget(heatrun_observer *observer)
{
    static const heatrun_followed NOTHING = {R(0.0), R(0.0)};
    observer->late = NOTHING;
    observer->apart = NOTHING;
    observer->prompt = NOTHING;
    observer->stays = NOTHING;
    observer->mean_K2 = R(0.0);
}

/* Judge the sensor; return whether this reading may correct the model. */
static int judge(heatrun_observer *observer, heatrun_real reading_degC, heatrun_real push_K,
                 int forced)
{
    heatrun_real seen[NUM_STATES];
    const heatrun_real fresh_K = ANSWER_SD*observer->fresh_K;
    const heatrun_real variance_K2 = foreseen(observer, seen) + fresh_K*fresh_K;
    const heatrun_real apart_K = reading_degC - shown(observer);
    const heatrun_real innovation_K = apart_K - observer->slow_K;
    const int is_first = observer->num_missing >= HEATRUN_LOST_STEPS;
    const heatrun_real num_steps = R(1 + observer->num_missing);
    const heatrun_real changed_K = observer->changed_K + observer->change_K;
    const heatrun_real own_K = is_first ? R(0.0) : reading_degC - observer->last_degC;
    /* from one reading to the next the constant errors drop out: noise shows there first */
    const heatrun_real next_jump_K = is_first ? R(0.0) : own_K - changed_K;
    const heatrun_real answer_K = ANSWER_SD*changed_K;
    const heatrun_real renewed = num_steps*(R(1.0) - SLOW_DECAY);
    const heatrun_real white_K2 = R(HEATRUN_READING_SD_K)*R(HEATRUN_READING_SD_K);
    const heatrun_real slow_K2 = R(HEATRUN_SLOW_SD_K)*R(HEATRUN_SLOW_SD_K);
    const heatrun_real next_jump_K2 = answer_K*answer_K + num_steps*num_steps*push_K*push_K
        + R(2.0)*white_K2 + R(2.0)*(renewed < R(1.0) ? renewed : R(1.0))*slow_K2
        + by_moment(observer->change_K - observer->last_change_K); /* the same moment each time */
    /* the jump of the reading before: now the inputs have had the time to show it */
    const heatrun_real jump_K = is_first ? R(0.0) : observer->jump_K;
    const heatrun_real jump_K2 = observer->jump_K2
        + (observer->num_missing > 0 ? R(0.0)
           : by_moment(observer->change_K - observer->last_change_K));
    const int is_jump = is_beyond(jump_K, jump_K2);
    const int is_same = !is_first && !(own_K < R(0.0)) && !(own_K > R(0.0));
    const int is_used = observer->belief == HEATRUN_SENSOR_OK;
    const heatrun_real stays_K2 = covariance(observer, SHOWN, SHOWN) + fresh_K*fresh_K
        + R(2.0)*covariance(observer, SHOWN, CONSTANT) + covariance(observer, CONSTANT, CONSTANT);
    int is_off = is_jump || is_beyond(innovation_K, variance_K2);
    heatrun_real stuck_K;
    int is_stuck, agrees;
    observer->changed_K = changed_K;
    observer->jump_K2 = jump_K2;
    if (!is_temperature(reading_degC)) {
        observer->num_missing += is_first ? 0 : 1;
        return 0;
    }
    observer->last_degC = reading_degC;
    observer->last_change_K = observer->change_K;
    observer->changed_K = R(0.0);
    observer->num_missing = 0;
    observer->apart_K = is_first ? apart_K
        : observer->apart_K + R(0.1)*(apart_K - observer->apart_K);
    /* an offset stays where it has jumped to, until it jumps back */
    if (is_jump && R(2.0)*size(observer->jumped_K + jump_K) < size(observer->jumped_K)) {
        observer->has_returned = 1;
    } else if (R(2.0)*size(observer->apart_K) > size(observer->jumped_K)
               && R(2.0)*size(innovation_K) > size(observer->jumped_K)) {
        observer->has_returned = 0;
    }
    if (is_jump && observer->is_own && size(jump_K) > size(observer->jumped_K)
        && (size(observer->jumped_K) > R(0.0) || (is_used && observer->is_proven))) {
        observer->jumped_K = jump_K;
    }
    is_off = is_off || (!observer->has_returned /* nearer to the jump than to the model */
        && R(2.0)*observer->jumped_K*innovation_K > observer->jumped_K*observer->jumped_K);
    agrees = !is_off && !is_beyond(next_jump_K, next_jump_K2); /* so far: it may be used */
    observer->jump_K = next_jump_K;
    observer->jump_K2 = next_jump_K2;
    observer->is_own = size(own_K) > size(changed_K);
    if (is_used != 0) {
        const int astray = is_astray(observer, apart_K, stays_K2);
        is_off = is_off || forced || astray;
    }
    observer->moved_K = is_same ? ANSWER_DECAY*observer->moved_K + observer->change_K : R(0.0);
    observer->pushed_K = is_same ? ANSWER_DECAY*observer->pushed_K + push_K : R(0.0);
    stuck_K = R(HEATRUN_STUCK_K) + R(3.0)*observer->pushed_K;
    is_stuck = !is_within(observer->moved_K, -stuck_K, stuck_K)
        || (observer->belief == HEATRUN_SENSOR_STUCK && is_same);
    observer->score += is_off ? 4 : observer->score > 0 ? -1 : 0;
    observer->score = observer->score < 4*HEATRUN_OFF_STEPS ? observer->score : 4*HEATRUN_OFF_STEPS;
    if (is_used != 0) {
        observer->num_good += observer->num_good < HEATRUN_PROVEN_STEPS ? 1 : 0;
        observer->is_proven = observer->is_proven || observer->num_good >= HEATRUN_PROVEN_STEPS;
        if (is_stuck || observer->score >= 4*HEATRUN_OFF_STEPS) {
            /* it has misled the model so far; one that nothing speaks for yet may be all wrong */
            widen(observer, is_stuck ? stuck_K
                  : observer->is_proven ? root(covariance(observer, SENSED, SENSED))
                                        : size(observer->apart_K));
            observer->belief = is_stuck ? HEATRUN_SENSOR_STUCK : HEATRUN_SENSOR_DISAGREES;
            observer->num_good = 0;
            observer->has_moved = 0;
        } else if (observer->score == 0) {
            observer->jumped_K = R(0.0);
        }
        return agrees && !is_first && observer->belief == HEATRUN_SENSOR_OK;
    }
    agrees = !is_stuck && observer->score == 0
        && observer->apart_K*observer->apart_K
            < R(HEATRUN_AGREE_SDS)*R(HEATRUN_AGREE_SDS)*variance_K2;
    observer->num_good = agrees ? observer->num_good + 1 : 0;
    /* while the load is steady, a sensor that lags agrees too */
    observer->swing_K = agrees ? R(0.97)*observer->swing_K + changed_K : R(0.0);
    if (!agrees) {
        observer->has_moved = 0;
    } else if (observer->has_moved == 0 && size(observer->swing_K) > R(HEATRUN_STUCK_K)) {
        observer->has_moved = 1;
        observer->num_good = 1; /* the readings from here on tell */
    }
    observer->belief = is_stuck ? HEATRUN_SENSOR_STUCK : HEATRUN_SENSOR_DISAGREES;
    if (observer->num_good >= HEATRUN_PROOF_STEPS
        || (observer->num_good >= HEATRUN_RECOVERY_STEPS
            && (!observer->is_proven
                || (has_jumped(observer) ? observer->has_returned : observer->has_moved)))) {
        widen(observer, observer->doubt_K); /* the other nodes may be farther off than this one */
        observer->doubt_K = R(0.0);
        observer->belief = HEATRUN_SENSOR_OK;
        observer->num_good = 0;
        observer->jumped_K = R(0.0);
        forget(observer);
    }
    return 0;
}

/* What is told of the sensor. */
static heatrun_sensor told(const heatrun_observer *observer)
{
    heatrun_sensor sensor = observer->belief;
    if (observer->num_missing >= HEATRUN_LOST_STEPS) {
        sensor = HEATRUN_SENSOR_LOST;
    } else if (sensor == HEATRUN_SENSOR_OK) {
        sensor = observer->num_missing > 0 ? HEATRUN_SENSOR_WAITING : HEATRUN_SENSOR_OK;
    } else if (observer->num_good > 0) {
        sensor = HEATRUN_SENSOR_RECOVERING;
    } else if (sensor == HEATRUN_SENSOR_DISAGREES && has_jumped(observer)) {
        sensor = HEATRUN_SENSOR_OFF;
    }
    return sensor;
}

/* Nothing is known but the temperatures, so well. */
static void spread(heatrun_observer *observer, heatrun_real sd_K)
{
    int i, j;
    for (i = 0; i < NUM_STATES; ++i) {
        for (j = 0; j <= i && j < CONSTANT; ++j) {
            observer->covariance[place(i, j)] = j < i ? R(0.0)
                : i < NUM_NODES                       ? sd_K*sd_K
                                                      : start_variance(i);
        }
    }
#if HEATRUN_HAS_LAG
    observer->shown_degC = sensed(observer->model.temperature_degC);
    for (i = 0; i < NUM_NODES; ++i) {
        observer->covariance[place(SHOWN, SHOWN)] += PART[i]*PART[i]*sd_K*sd_K;
        observer->covariance[place(SHOWN, i)] = PART[i]*sd_K*sd_K;
    }
#endif
    for (i = 0; i < NUM_HEATS; ++i) {
        observer->heat_W[i] = R(0.0);
    }
    observer->slow_K = R(0.0);
}

heatrun_status heatrun_observer_start(heatrun_observer *observer,
                                      const heatrun_real temperature_degC[HEATRUN_NUM_NODES],
                                      heatrun_real sd_K)
{
    if (!is_within(sd_K, R(0.0), R(MOST_SD_K))
        || heatrun_start(&observer->model, temperature_degC) != HEATRUN_OK) {
        return HEATRUN_STATE_INVALID;
    }
    spread(observer, sd_K);
    observer->last_degC = R(0.0);
    observer->last_change_K = R(0.0);
    observer->jump_K = R(0.0);
    observer->jump_K2 = R(0.0);
    observer->change_K = R(0.0);
    observer->changed_K = R(0.0);
    observer->apart_K = R(0.0);
    forget(observer);
    observer->late_K = R(0.0);
    observer->jumped_K = R(0.0);
    observer->moved_K = R(0.0);
    observer->pushed_K = R(0.0);
    observer->fresh_K = R(0.0);
    observer->swing_K = R(0.0);
    observer->doubt_K = R(0.0);
    observer->score = 0;
    observer->num_good = 0;
    observer->num_missing = HEATRUN_LOST_STEPS; /* no reading yet */
    observer->is_proven = 0;
    observer->is_own = 0;
    observer->has_moved = 0;
    observer->has_returned = 0;
    observer->belief = HEATRUN_SENSOR_OK;
    return HEATRUN_OK;
}

heatrun_estimate heatrun_observer_step(heatrun_observer *observer, const heatrun_inputs *inputs,
                                       heatrun_real reading_degC)
{
    const heatrun_real shown_degC = shown(observer);
#if HEATRUN_HAS_LAG
    const heatrun_real before_degC = sensed(observer->model.temperature_degC);
#endif
    heatrun_real more_W[NUM_NODES] = {R(0.0)};
    heatrun_real push_K = R(0.0);
    heatrun_estimate estimate;
    drive at;
    int i, is_lost, forced = 0;
    for (i = 0; i < NUM_HEATS; ++i) {
        more_W[HEATED[i]] = observer->heat_W[i];
    }
    estimate.status = step_with(&observer->model, inputs, &at, more_W, R(HEATRUN_STEP_S));
    is_lost = estimate.status == HEATRUN_STATE_INVALID;
    if (estimate.status == HEATRUN_OK) {
        heatrun_real now_W[NUM_NODES];
        heats(&at, observer->model.temperature_degC, now_W);
        predict_covariance(observer, &at, inputs, now_W);
        push_K = R(HEATRUN_STEP_S)*heat_sd(&at, now_W, SENSED)
            /at.parameters->capacitance_J_per_K[SENSED];
        forced = is_forced(observer, &at, now_W);
#if HEATRUN_HAS_LAG
        observer->shown_degC = LAG_DECAY*observer->shown_degC
            + (R(1.0) - LAG_MEAN)*sensed(observer->model.temperature_degC)
            + (LAG_MEAN - LAG_DECAY)*before_degC;
#endif
    } else {
        widen(observer, BLIND_K);
        observer->is_proven = 0; /* the model is not where the machine is */
        observer->num_good = 0;
    }
    for (i = 0; i < NUM_HEATS; ++i) {
        observer->heat_W[i] *= HEAT_DECAY;
    }
    observer->slow_K *= SLOW_DECAY;
    for (i = 0; i < NUM_NODES; ++i) {
        is_lost = is_lost || !(covariance(observer, i, i) <= R(MOST_SD_K)*R(MOST_SD_K));
    }
    if (is_lost != 0) { /* of the model: the reading is what is left */
        for (i = 0; i < NUM_NODES && is_temperature(reading_degC); ++i) {
            observer->model.temperature_degC[i] = reading_degC;
        }
        spread(observer, R(MOST_SD_K));
        observer->is_proven = 0;
    }
    observer->change_K = shown(observer) - shown_degC;
    observer->fresh_K = ANSWER_DECAY*observer->fresh_K + observer->change_K;
    observer->late_K = LATE_DECAY*observer->late_K + observer->change_K;
    if (judge(observer, reading_degC, push_K, forced) != 0) {
        correct(observer, reading_degC - shown(observer) - observer->slow_K);
    }
    /* model or sensor may be right: while they disagree, the band has both in it */
    observer->doubt_K *= HEAT_DECAY;
    if (has_jumped(observer) || (observer->score == 0 && observer->belief == HEATRUN_SENSOR_OK)) {
        observer->doubt_K = R(0.0);
    } else if (R(0.6)*size(observer->apart_K) > observer->doubt_K) {
        observer->doubt_K = R(0.6)*size(observer->apart_K); /* two sds reach beyond the reading */
    }
    for (i = 0; i < NUM_NODES; ++i) {
        estimate.temperature_degC[i] = observer->model.temperature_degC[i];
        estimate.sd_K[i] = root(covariance(observer, i, i)) + observer->doubt_K;
    }
    estimate.sensor = told(observer);
    return estimate;
}
