
/* Observer. Heat that the network misses: on each heated node a Gauss-Markov process, with the
 * size and the time of the run. */
#define NUM_HEATS HEATRUN_NUM_HEATS
#define NUM_STATES HEATRUN_NUM_STATES
#define SENSED HEATRUN_SENSED_NODE

static const int HEATED[NUM_HEATS] = {$heated};
static const heatrun_real HEAT_SD_W = R($heat_sd);
static const heatrun_real HEAT_DECAY = R($heat_decay); /* over a step */
/* The noise of readings is correlated: white noise that is as strong over minutes. */
static const heatrun_real READING_VARIANCE_K2 =
    R($noise_steps)*R(HEATRUN_READING_SD_K)*R(HEATRUN_READING_SD_K);
static const heatrun_real BLIND_K = R($blind); /* growth in a step without inputs */

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

/* P -> F P F' + Q. F column by column: the step of the network without sinks and losses. */
static void predict_covariance(heatrun_observer *observer, const drive *at)
{
    heatrun_real F[NUM_STATES][NUM_STATES] = {{R(0.0)}};
    heatrun_real product[NUM_STATES][NUM_STATES];
    drive bare = *at;
    int i, j, k;
    bare.coefficient_degC = R(0.0);
    bare.losses_W = R(0.0);
    bare.sinks_degC[0] = R(0.0);
    bare.sinks_degC[1] = R(0.0);
    for (j = 0; j < NUM_STATES; ++j) {
        heatrun_state column = {{R(0.0)}, {R(0.0)}};
        for (i = 0; i < NUM_NODES; ++i) {
            bare.heat_W[i] = R(0.0);
        }
        if (j < NUM_NODES) {
            column.temperature_degC[j] = R(1.0);
        } else {
            bare.heat_W[HEATED[j - NUM_NODES]] = R(1.0);
            F[j][j] = HEAT_DECAY;
        }
        advance(&bare, &column);
        for (i = 0; i < NUM_NODES; ++i) {
            F[i][j] = column.temperature_degC[i];
        }
    }
    for (i = 0; i < NUM_STATES; ++i) {
        for (j = 0; j < NUM_STATES; ++j) {
            product[i][j] = R(0.0);
            for (k = 0; k < NUM_STATES; ++k) {
                product[i][j] += F[i][k]*observer->covariance[k][j];
            }
        }
    }
    for (i = 0; i < NUM_STATES; ++i) {
        for (j = 0; j <= i; ++j) {
            heatrun_real sum = R(0.0);
            for (k = 0; k < NUM_STATES; ++k) {
                sum += product[i][k]*F[j][k];
            }
            observer->covariance[i][j] = sum;
            observer->covariance[j][i] = sum;
        }
        if (i >= NUM_NODES) {
            observer->covariance[i][i] += HEAT_SD_W*HEAT_SD_W*(R(1.0) - HEAT_DECAY*HEAT_DECAY);
        }
    }
}

/* The standard deviation of each node grows by some kelvin. */
static void widen(heatrun_observer *observer, heatrun_real more_K)
{
    int i;
    for (i = 0; i < NUM_NODES; ++i) {
        const heatrun_real sd_K = root(observer->covariance[i][i]);
        observer->covariance[i][i] += (R(2.0)*sd_K + more_K)*more_K;
    }
}

static void correct(heatrun_observer *observer, heatrun_real innovation_K)
{
    heatrun_real seen[NUM_STATES];
    heatrun_real variance_K2;
    int i, j;
    for (i = 0; i < NUM_STATES; ++i) {
        seen[i] = observer->covariance[i][SENSED];
    }
    variance_K2 = seen[SENSED] + READING_VARIANCE_K2;
    for (i = 0; i < NUM_STATES; ++i) {
        const heatrun_real change = seen[i]/variance_K2*innovation_K;
        if (i < NUM_NODES) {
            observer->model.temperature_degC[i] += change;
        } else {
            observer->heat_W[i - NUM_NODES] += change;
        }
        for (j = 0; j < NUM_STATES; ++j) {
            observer->covariance[i][j] -= seen[i]*seen[j]/variance_K2;
        }
        if (!(observer->covariance[i][i] > R(0.0))) {
            observer->covariance[i][i] = R(0.0); /* rounding */
        }
    }
}

/* Judge the sensor; return whether this reading may correct the model. */
static int judge(heatrun_observer *observer, heatrun_real reading_degC, heatrun_real change_K)
{
    const heatrun_real innovation_K =
        reading_degC - observer->model.temperature_degC[SENSED];
    const heatrun_real variance_K2 = observer->covariance[SENSED][SENSED]
        + R(HEATRUN_READING_SD_K)*R(HEATRUN_READING_SD_K);
    const int is_off =
        innovation_K*innovation_K > R(HEATRUN_OFF_SDS)*R(HEATRUN_OFF_SDS)*variance_K2;
    const int is_same =
        reading_degC >= observer->last_degC && reading_degC <= observer->last_degC;
    if (!is_temperature(reading_degC)) {
        observer->sensor = HEATRUN_SENSOR_LOST;
        observer->num_off = 0;
        observer->num_good = 0;
        return 0;
    }
    observer->last_degC = reading_degC;
    observer->moved_K = is_same ? observer->moved_K + change_K : R(0.0);
    if (!is_off) {
        observer->num_off = 0;
    } else if (observer->num_off < HEATRUN_OFF_STEPS) {
        ++observer->num_off;
    }
    if (!is_within(observer->moved_K, R(-HEATRUN_STUCK_K), R(HEATRUN_STUCK_K))
        || (observer->sensor == HEATRUN_SENSOR_STUCK && is_same)) {
        if (observer->sensor == HEATRUN_SENSOR_OK) {
            widen(observer, R(HEATRUN_STUCK_K)); /* it has misled the model so far */
        }
        observer->sensor = HEATRUN_SENSOR_STUCK;
        observer->num_good = 0;
    } else if (observer->num_off >= HEATRUN_OFF_STEPS) {
        observer->sensor = HEATRUN_SENSOR_OFF;
        observer->num_good = 0;
    } else if (observer->sensor != HEATRUN_SENSOR_OK) {
        observer->sensor = HEATRUN_SENSOR_RECOVERING;
        observer->num_good = is_off ? 0 : observer->num_good + 1;
        if (observer->num_good >= HEATRUN_RECOVERY_STEPS) {
            observer->sensor = HEATRUN_SENSOR_OK;
        }
    }
    return observer->sensor == HEATRUN_SENSOR_OK && !is_off;
}

heatrun_status heatrun_observer_start(heatrun_observer *observer,
                                      const heatrun_real temperature_degC[HEATRUN_NUM_NODES],
                                      heatrun_real sd_K)
{
    int i, j;
    if (!is_within(sd_K, R(0.0), R(300.0))
        || heatrun_start(&observer->model, temperature_degC) != HEATRUN_OK) {
        return HEATRUN_STATE_INVALID;
    }
    for (i = 0; i < NUM_STATES; ++i) {
        const heatrun_real sd = i < NUM_NODES ? sd_K : HEAT_SD_W;
        for (j = 0; j < NUM_STATES; ++j) {
            observer->covariance[i][j] = i == j ? sd*sd : R(0.0);
        }
    }
    for (i = 0; i < NUM_HEATS; ++i) {
        observer->heat_W[i] = R(0.0);
    }
    observer->last_degC = R(HEATRUN_MIN_DEGC) - R(1.0); /* no reading yet */
    observer->moved_K = R(0.0);
    observer->num_off = 0;
    observer->num_good = 0;
    observer->sensor = HEATRUN_SENSOR_OK;
    return HEATRUN_OK;
}

heatrun_estimate heatrun_observer_step(heatrun_observer *observer, const heatrun_inputs *inputs,
                                       heatrun_real reading_degC)
{
    const heatrun_real before_degC = observer->model.temperature_degC[SENSED];
    heatrun_real more_W[NUM_NODES] = {R(0.0)};
    heatrun_estimate estimate;
    drive at;
    int i;
    for (i = 0; i < NUM_HEATS; ++i) {
        more_W[HEATED[i]] = observer->heat_W[i];
    }
    estimate.status = step_with(&observer->model, inputs, &at, more_W);
    if (estimate.status == HEATRUN_OK) {
        predict_covariance(observer, &at);
        for (i = 0; i < NUM_HEATS; ++i) {
            observer->heat_W[i] *= HEAT_DECAY;
        }
    } else {
        widen(observer, BLIND_K);
    }
    if (judge(observer, reading_degC,
              observer->model.temperature_degC[SENSED] - before_degC)) {
        correct(observer, reading_degC - observer->model.temperature_degC[SENSED]);
    }
    for (i = 0; i < NUM_NODES; ++i) {
        estimate.temperature_degC[i] = observer->model.temperature_degC[i];
        estimate.sd_K[i] = root(observer->covariance[i][i]);
    }
    estimate.sensor = observer->sensor;
    return estimate;
}
