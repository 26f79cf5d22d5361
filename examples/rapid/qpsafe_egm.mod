MODULE qpsafe_egm
    ! Let a PC guide the robot's joints over EGM (option 689-1, RobotWare 6.07 or later), e.g. "qpsafe stream".
    ! What every number means, and what else to configure, stands in README.md beside this file.
    ! Try it in RobotStudio first, then in manual mode at reduced speed.

    ! Where the robot goes before it is guided [deg]: the same pose that the PC's task starts from.
    CONST jointtarget start_pose := [[0, -5, 0, 0, 85, 0], [9E9, 9E9, 9E9, 9E9, 9E9, 9E9]];

    ! Name of the transmission protocol (type UDPUC) in "Communication": the PC's address and port.
    CONST string pc_device := "QPSAFE";

    CONST num comm_timeout := 0.5;      ! s without an answer until ERR_UDPUC_COMM
    CONST num max_speed := 450;         ! deg/s; the default of 1 would all but stop the robot
    CONST num low_pass := 20;           ! Hz
    CONST num sample_rate := 4;         ! ms
    CONST num cond_time := 86400;       ! s at the goal until EGMRunJoint returns: in effect never
    CONST num ramp_in := 0.05;          ! s; the PC ramps too
    CONST num ramp_out := 0.5;          ! s
    CONST num corr_gain := 1;           ! follow positions; 0 would follow speeds alone, and drift
    CONST egm_minmax near := [-0.5, 0.5];  ! deg, what counts as at the goal

    ! FALSE: after a lost connection a person presses start. TRUE: the robot is guided anew by itself.
    CONST bool goes_on_by_itself := FALSE;
    CONST num pause := 1;               ! s before it is

    VAR egmident guide;

    PROC main()
        MoveAbsJ start_pose, v100, fine, tool0;
        WHILE TRUE DO
            be_guided;
        ENDWHILE
    ENDPROC

    ! One run: until EGMRunJoint returns, or the connection is lost. Both end here, and main begins the next one.
    PROC be_guided()
        EGMReset guide;
        EGMGetId guide;
        EGMSetupUC ROB_1, guide, "default", pc_device \Joint \CommTimeout:=comm_timeout;
        EGMActJoint guide \Tool:=tool0 \WObj:=wobj0
            \J1:=near \J2:=near \J3:=near \J4:=near \J5:=near \J6:=near
            \LpFilter:=low_pass \SampleRate:=sample_rate \MaxSpeedDeviation:=max_speed;
        EGMRunJoint guide, EGM_STOP_HOLD \J1 \J2 \J3 \J4 \J5 \J6
            \CondTime:=cond_time \RampInTime:=ramp_in \RampOutTime:=ramp_out \PosCorrGain:=corr_gain;
        EGMReset guide;
    ERROR
        IF ERRNO = ERR_UDPUC_COMM THEN
            TPWrite "EGM: no answer from the PC for " \Num:=comm_timeout;
            EGMReset guide;
            IF goes_on_by_itself THEN
                WaitTime pause;
            ELSE
                TPWrite "Start qpsafe stream again, then press start.";
                Stop \NoRegain;
            ENDIF
            TRYNEXT;
        ENDIF
    ENDPROC

    ! For a menu, an interrupt (ISignalDI) or an event routine: end the guidance where the robot is.
    PROC end_guidance()
        IF EGMGetState(guide) = EGM_STATE_RUNNING THEN
            EGMStop guide, EGM_STOP_HOLD \RampOutTime:=ramp_out;
        ENDIF
        EGMReset guide;
    ENDPROC
ENDMODULE
