    {$capacitance_J_per_K},
    {$resistance_K_per_W},
    {$share},
    R($Rs0_ohm),
    {$copper_moved},
    R($resistance_gain),
    R($coefficient_more_degC),
    R($standby_W),
    R($loss_gain),
    R($recirculation_K_per_W),
#if HEATRUN_HAS_SPEED
    {$speed_gain},
    {$speed_exponent},
    {$speed_loss_W},
    {$speed_squared_loss_W},
    {$moved_W},
    {$moved_exponent},
    {$moved_by_load},
    R($ac_copper),
    R($stray_W),
    R($outside_share),
    R($outside_exponent),
    {$friction_Nm},
    {$friction_fall_per_K},
#endif
#if HEATRUN_HAS_FAN
    {$fan_gain},
#endif
#if HEATRUN_HAS_COOLANT
    R($coolant_share),
#endif
#if HEATRUN_HAS_WARMTH
    {$radiating_m2},
    {$natural_share},
    {$natural_exponent},
    {$warmth_gain_per_K},
#endif
